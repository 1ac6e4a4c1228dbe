"""Meshes of bodies from files of triangles: their surface is remeshed to the sizes that F needs."""
