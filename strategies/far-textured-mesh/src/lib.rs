//! Textured LOD meshes: SVMesh and MVMesh with projective textures.
