//! Rays: images of posed bodies, by traversal of a bounding-volume tree and a watertight test of triangles.

pub mod batch;
pub mod build;
pub mod camera;
pub mod hits;
pub mod image;
pub mod nearest_point;
pub mod packet;
pub mod scene;
pub mod smooth_hits;
pub mod surface;
pub mod traversal;
pub mod tree;
pub mod triangle_block;
pub mod watertight;
