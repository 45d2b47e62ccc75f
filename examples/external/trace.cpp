// An external program for atra: a bounding volume hierarchy split at the median, one ray after another, one thread.
//
//     c++ -O2 -std=c++17 -o trace trace.cpp
//     atra method=program method.command=./trace scene=cornell_box
//
// Replace `build` and `trace` by your own; the protocol is described in experiments/methods/outside/program.py.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <limits>
#include <numeric>
#include <sstream>
#include <string>
#include <vector>

struct Vec { double x, y, z; };
static Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
static double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

struct Ray { float origin[3], tnear, direction[3], tfar; };
struct Box {
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    void add(const float* point) {
        for (int k = 0; k < 3; k++) { low[k] = std::min(low[k], point[k]); high[k] = std::max(high[k], point[k]); }
    }
};
struct Node { Box box; int right; int first, count; };  // the left child follows its parent; count 0 = inner node

static const uint32_t MISS = 0xFFFFFFFFu;
static std::vector<float> vertices;
static std::vector<uint32_t> faces, order;
static std::vector<Node> nodes;
static std::vector<Ray> rays;
static std::vector<float> t_of;
static std::vector<uint32_t> face_of;

static const float* corner(uint32_t face, int k) { return &vertices[3 * size_t(faces[3 * size_t(face) + k])]; }
static Vec point(const float* p) { return {p[0], p[1], p[2]}; }
static float middle(uint32_t face, int axis) { return corner(face, 0)[axis] + corner(face, 1)[axis] + corner(face, 2)[axis]; }

static void build(int first, int count) {
    int own = int(nodes.size());
    nodes.push_back({{}, 0, first, count});
    for (int i = first; i < first + count; i++)
        for (int k = 0; k < 3; k++) nodes[own].box.add(corner(order[i], k));
    if (count <= 4) return;
    int axis = 0;
    auto size = [&](int k) { return nodes[own].box.high[k] - nodes[own].box.low[k]; };
    for (int k = 1; k < 3; k++) if (size(k) > size(axis)) axis = k;
    int half = count / 2;
    std::nth_element(order.begin() + first, order.begin() + first + half, order.begin() + first + count,
                     [&](uint32_t a, uint32_t b) { return middle(a, axis) < middle(b, axis); });
    nodes[own].count = 0;
    build(first, half);
    nodes[own].right = int(nodes.size());
    build(first + half, count - half);
}

static bool enters(const Box& box, const Ray& ray, double tfar) {
    double near = ray.tnear, far = tfar;
    for (int k = 0; k < 3; k++) {
        double inverse = 1.0 / ray.direction[k];
        double a = (box.low[k] - double(ray.origin[k])) * inverse, b = (box.high[k] - double(ray.origin[k])) * inverse;
        if (std::isnan(a) || std::isnan(b)) continue;  // the ray lies in a side of the box
        near = std::max(near, std::min(a, b)), far = std::min(far, std::max(a, b));
    }
    return near <= far * (1 + 1e-12);
}

// The sign of a side is the same for both triangles that share it, to the last bit, so no ray slips between them.
static double distance(uint32_t face, const Ray& ray) {
    Vec o = point(ray.origin), d = point(ray.direction);
    Vec a = point(corner(face, 0)) - o, b = point(corner(face, 1)) - o, c = point(corner(face, 2)) - o;
    double u = dot(cross(c, b), d), v = dot(cross(a, c), d), w = dot(cross(b, a), d);
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return NAN;
    Vec normal = cross(b - a, c - a);
    return dot(a, normal) / dot(d, normal);
}

static void trace(const Ray& ray, float& t, uint32_t& face) {
    double nearest = ray.tfar;
    face = MISS;
    int stack[64], used = 0;
    stack[used++] = 0;
    while (used > 0) {
        const Node& node = nodes[stack[--used]];
        if (!enters(node.box, ray, nearest)) continue;
        if (node.count == 0) { stack[used++] = node.right; stack[used++] = int(&node - nodes.data()) + 1; }
        for (int i = node.first; i < node.first + node.count; i++) {
            double found = distance(order[i], ray);
            if (found > ray.tnear && found < nearest) { nearest = found; face = order[i]; }
        }
    }
    t = face == MISS ? INFINITY : float(nearest);
}

template <class T> static bool read(std::ifstream& file, std::vector<T>& into, size_t count) {
    into.resize(count);
    return bool(file.read(reinterpret_cast<char*>(into.data()), std::streamsize(count * sizeof(T))));
}

int main() {
    std::string line, word, path;
    auto now = [] { return std::chrono::steady_clock::now(); };
    auto since = [&](auto start) { return std::chrono::duration<double>(now() - start).count(); };
    while (std::getline(std::cin, line)) {
        std::istringstream said(line);
        size_t count = 0, more = 0;
        said >> word;
        if (word == "end") return 0;
        if (word == "atra-rays") { std::cout << "ok trace.cpp 1" << std::endl; continue; }
        if (word == "threads") { std::cout << "ok" << std::endl; continue; }  // one is enough for any number
        if (word != "trace") said >> count;
        if (word == "mesh") said >> more;
        std::getline(said >> std::ws, path);
        if (word == "mesh" || word == "rays") {
            std::ifstream file(path, std::ios::binary);
            bool whole = word == "rays" ? read(file, rays, count)
                                        : read(file, vertices, 3 * count) && read(file, faces, 3 * more);
            if (!whole) { std::cout << "error cannot read " << path << std::endl; continue; }
            if (word == "rays") { std::cout << "ok" << std::endl; continue; }
            auto start = now();
            order.resize(more);
            std::iota(order.begin(), order.end(), 0u);
            nodes.clear();
            build(0, int(more));
            std::cout << "ok " << since(start) << std::endl;
        } else if (word == "trace") {
            t_of.resize(rays.size()), face_of.resize(rays.size());
            auto start = now();
            for (size_t i = 0; i < rays.size(); i++) trace(rays[i], t_of[i], face_of[i]);
            double seconds = since(start);
            std::ofstream file(path, std::ios::binary);
            file.write(reinterpret_cast<char*>(t_of.data()), std::streamsize(4 * t_of.size()));
            file.write(reinterpret_cast<char*>(face_of.data()), std::streamsize(4 * face_of.size()));
            file.close();
            if (file) std::cout << "ok " << seconds << std::endl;
            else std::cout << "error cannot write " << path << std::endl;
        } else {
            std::cout << "error unknown command " << word << std::endl;
        }
    }
}
