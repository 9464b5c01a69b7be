"""Poses, triangle meshes and their files, shapes, cameras."""
