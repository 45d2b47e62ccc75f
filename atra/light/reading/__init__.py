"""Scenes from files: glTF, OBJ with MTL, and whatever trimesh reads."""
