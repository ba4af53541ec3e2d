"""Readers of bodies: glTF, URDF, OBJ and MakeHuman, plain meshes."""
