"""Meshes of bodies that files of triangles give: their surface is meshed anew, to the sizes that F asks for."""
