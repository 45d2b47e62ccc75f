"""Labels of a small BOP dataset made here: masks and depth equal the reference's, and a stopped run goes on."""

import json

import cv2
import numpy as np
import pytest
import trimesh

import atra
from atra.command.main import main
from atra.compat.bop import ObjectPose, Renderer
from tests.judge.reference import brute_force

SIZE, INTRINSICS = (48, 36), (40.0, 42.0, 23.0, 18.5)
K = [40.0, 0, 23.0, 0, 42.0, 18.5, 0, 0, 1]


def model(number):
    return trimesh.creation.box((60, 40, 50)) if number == 1 else trimesh.creation.icosphere(1, 30)


def mesh_of(number):
    made = model(number)
    return atra.Mesh(np.asarray(made.vertices, np.float32), np.asarray(made.faces, np.uint32))


def turn(seed):
    return cv2.Rodrigues(np.random.default_rng(seed).normal(size=3))[0]


FRAMES = {
    0: [(1, turn(0), [0, 0, 200]), (2, turn(1), [10, 5, 150])],
    3: [(2, turn(2), [-80, 0, 170]), (1, turn(3), [30, 10, 260]), (2, turn(4), [0, 0, 400])],
    4: [(1, turn(5), [0, 0, -200])],
}


def write_dataset(folder):
    scene = folder / "test" / "000002"
    scene.mkdir(parents=True)
    (folder / "models").mkdir()
    for number in (1, 2):
        model(number).export(folder / "models" / f"obj_{number:06d}.ply")
    (folder / "camera.json").write_text(json.dumps(dict(zip(("width", "height"), SIZE, strict=True))), encoding="utf-8")
    cameras = {str(number): {"cam_K": K, "depth_scale": 0.1} for number in FRAMES}
    objects = {
        str(number): [
            {"obj_id": one, "cam_R_m2c": turned.ravel().tolist(), "cam_t_m2c": place} for one, turned, place in given
        ]
        for number, given in FRAMES.items()
    }
    (scene / "scene_camera.json").write_text(json.dumps(cameras), encoding="utf-8")
    (scene / "scene_gt.json").write_text(json.dumps(objects), encoding="utf-8")


def truth_of(pose, beyond=0):
    """Depth of an object by brute force, inf = nothing, on a canvas with `beyond` sizes of the image on every side."""
    number, turned, place = pose
    width, height = SIZE
    shifted = np.array(K).reshape(3, 3) + [[0, 0, beyond * width], [0, 0, beyond * height], [0, 0, 0]]
    camera = atra.Camera.from_opencv(shifted, turned, place, (1 + 2 * beyond) * width, (1 + 2 * beyond) * height)
    return brute_force(mesh_of(number), camera).depth


def run(monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", ["atra", "render", "bop", *map(str, arguments)])
    return main()


def read(path):
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


def test_masks_depth_shares_and_boxes_of_a_dataset_are_those_of_the_reference(tmp_path, monkeypatch, capsys):
    write_dataset(tmp_path / "small")
    assert run(monkeypatch, tmp_path / "small", "--workers", 2) == 0
    assert capsys.readouterr().out.endswith("3 frames written\n")
    folder = tmp_path / "small_labels" / "test" / "000002"
    info = json.loads((folder / "scene_gt_info.json").read_text(encoding="utf-8"))
    assert list(info) == ["0", "3", "4"]
    for number, poses in FRAMES.items():
        depths = np.stack([truth_of(pose) for pose in poses])
        nearest, owner = depths.min(axis=0), depths.argmin(axis=0)
        depth = read(folder / "depth" / f"{number:06d}.png")
        np.testing.assert_allclose(depth, np.where(np.isfinite(nearest), nearest * 10, 0), atol=0.51)
        for place, pose in enumerate(poses):
            whole = np.isfinite(truth_of(pose, beyond=1))
            seen = np.isfinite(nearest) & (owner == place)
            name = f"{number:06d}_{place:06d}.png"
            np.testing.assert_array_equal(read(folder / "mask" / name) == 255, np.isfinite(depths[place]))
            np.testing.assert_array_equal(read(folder / "mask_visib" / name) == 255, seen)
            told = info[str(number)][place]
            assert (told["px_count_all"], told["px_count_visib"]) == (whole.sum(), seen.sum())
            assert told["visib_fract"] == pytest.approx(seen.sum() / max(whole.sum(), 1), abs=1e-3)
            if whole.any():
                rows, columns = np.flatnonzero(whole.any(axis=1)), np.flatnonzero(whole.any(axis=0))
                corner = [columns[0] - SIZE[0], rows[0] - SIZE[1]]
                assert told["bbox_obj"] == [*corner, np.ptp(columns) + 1, np.ptp(rows) + 1]
            if not seen.any():
                assert told["bbox_visib"] == [-1, -1, -1, -1]


def test_a_run_that_was_stopped_goes_on_with_the_frames_that_are_missing(tmp_path, monkeypatch, capsys):
    write_dataset(tmp_path / "small")
    run(monkeypatch, tmp_path / "small")
    folder = tmp_path / "small_labels" / "test" / "000002"
    whole = (folder / "scene_gt_info.json").read_bytes()
    (folder / "info" / "000003.json").unlink()
    (folder / "depth" / "000003.png").unlink()
    (folder / "depth" / "000000.png").write_bytes(b"not drawn again")
    assert run(monkeypatch, tmp_path / "small") == 0
    assert capsys.readouterr().out.endswith("1 frames written, 2 were there\n")
    assert read(folder / "depth" / "000003.png").shape == SIZE[::-1]
    assert (folder / "depth" / "000000.png").read_bytes() == b"not drawn again"
    assert (folder / "scene_gt_info.json").read_bytes() == whole


@pytest.mark.parametrize(("name", "change", "said"), [
    ("scene_gt", lambda given: given["3"].append({"obj_id": 9}), "obj_000009.ply"),
    ("scene_gt", lambda given: given["3"][0].update(obj_id="x"), "000002, image 3: obj_id is 'x', expected a whole"),
    ("scene_camera", lambda given: given.pop("3"), "image '3': it has no camera in scene_camera.json"),
])  # fmt: skip
def test_a_dataset_that_cannot_be_used_is_refused_before_anything_is_drawn(
    name, change, said, tmp_path, monkeypatch, capsys
):
    write_dataset(tmp_path / "small")
    path = tmp_path / "small" / "test" / "000002" / f"{name}.json"
    given = json.loads(path.read_text(encoding="utf-8"))
    change(given)
    path.write_text(json.dumps(given), encoding="utf-8")
    assert run(monkeypatch, tmp_path / "small") == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "small_labels").exists()


def test_a_broken_pose_is_named_and_does_not_cost_the_other_frames(tmp_path, monkeypatch, capsys):
    write_dataset(tmp_path / "small")
    path = tmp_path / "small" / "test" / "000002" / "scene_gt.json"
    given = json.loads(path.read_text(encoding="utf-8"))
    given["3"][0]["cam_R_m2c"] = [1.0] * 9
    path.write_text(json.dumps(given), encoding="utf-8")
    assert run(monkeypatch, tmp_path / "small") == 1
    told = capsys.readouterr()
    assert "000002, image 3: R is no rotation: R R^T is up to 3" in told.err
    assert told.out.endswith("2 frames written, 1 failed\n")


def test_the_renderer_has_the_interface_of_the_toolkit(tmp_path):
    model(1).export(tmp_path / "a.ply")
    renderer = Renderer(*SIZE)
    renderer.add_object(7, tmp_path / "a.ply", surf_color=(1, 0, 0))
    depth = renderer.render_object(7, turn(0), np.array([[0.0], [0], [200]]), *INTRINSICS)["depth"]
    truth = truth_of((1, turn(0), [0, 0, 200]))
    np.testing.assert_allclose(depth, np.where(np.isfinite(truth), truth, 0), rtol=1e-5)
    shifted = Renderer(*SIZE, pixel_centre=0.5)
    shifted.add_object(7, mesh_of(1))
    fx, fy, cx, cy = INTRINSICS
    same = shifted.render_object(7, turn(0), [0, 0, 200], fx, fy, cx + 0.5, cy + 0.5)["depth"]
    np.testing.assert_array_equal(same, depth)
    renderer.remove_object(7)
    renderer.remove_object(7)
    with pytest.raises(atra.InputError, match="object 7 is unknown"):
        renderer.label([ObjectPose(7, turn(0), [0, 0, 200])], *INTRINSICS)
    with pytest.raises(atra.InputError, match="mode is 'rgb', expected depth"):
        Renderer(*SIZE, mode="rgb")
    renderer.close()


def test_help_starts_with_examples(monkeypatch, capsys):
    with pytest.raises(SystemExit):
        run(monkeypatch, "--help")
    assert capsys.readouterr().out.startswith("usage: atra render bop lmo --split test\n")
