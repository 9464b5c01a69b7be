//! Geometry of bodies: poses, boxes, triangles, flat regions of meshes, smooth normals of the curved surfaces that meshes
//! approximate, and OBJ files.

pub mod aabb;
pub mod components;
pub mod curved_triangle;
pub mod flat_regions;
pub mod moving_triangle;
pub mod obj;
pub mod pose;
pub mod smooth_normals;
pub mod topology;
pub mod triangle;
