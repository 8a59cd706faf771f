"""Programs, paths and meshes."""
