//! Triangles of OBJ files.
//!
//! ```text
//! bytes ── text ── statements ── tobj ── vertices, corners of faces ── polygon ── triangles
//! ```
//!
//! tobj reads the numbers. `statements` hands it vertices and faces, and keeps what it would lose: the line of a fault
//! and the names of objects, groups and materials. `polygon` cuts faces into triangles. `fault` finds the lines of
//! errors.

use std::path::Path;

use glam::DVec3;
use tobj::LoadError;

use crate::cancel::Cancel;
use crate::error::{Error, Result};

mod fault;
mod polygon;
mod statements;
#[cfg(test)]
mod tests;
mod text;

use fault::Fault;
pub use polygon::triangulate;
use statements::{Reader, statements};
use text::decode;

/// Limit of coordinates, whatever the unit of the file: no body is so large, and squares stay finite.
const LARGEST: f64 = 1e15;

/// Triangles of an OBJ file, in file order.
///
/// `triangles`, `object`, `group` and `material` have one entry per triangle. A name is "" for faces that no `o`, `g`
/// or `usemtl` precedes; names without a face are not listed. Triangles without area are kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Obj {
    /// Vertices `v` of the file, in file order: none merged, none dropped, in the unit of the file.
    pub vertices: Vec<[f64; 3]>,
    /// Indices into `vertices`, with the winding of the face.
    pub triangles: Vec<[u32; 3]>,
    /// Index into `object_names`.
    pub object: Vec<u32>,
    /// Index into `group_names`.
    pub group: Vec<u32>,
    /// Index into `material_names`.
    pub material: Vec<u32>,
    /// Names given by `o`, in the order of their first face.
    pub object_names: Vec<String>,
    /// Names given by `g`, in the order of their first face; `g a b` is the one name "a b".
    pub group_names: Vec<String>,
    /// Names given by `usemtl`, in the order of their first face. The material file is never opened.
    pub material_names: Vec<String>,
}

/// Read an OBJ file until a request to stop; see [`parse_obj`].
pub fn read_obj(path: &Path, cancel: &Cancel) -> Result<Obj> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io {
        path: path.to_owned(),
        source,
    })?;
    parse_obj(&bytes, path, cancel)
}

/// Triangles of an OBJ file held in memory; `path` only appears in messages.
///
/// Text is UTF-8, or UTF-16 with a byte-order mark; it has no NUL. Coordinates are below 1e15. Everything but vertices,
/// faces and their names is ignored. Faces with more than three corners are cut by [`triangulate`]; a file that gives
/// no triangle is an error.
pub fn parse_obj(bytes: &[u8], path: &Path, cancel: &Cancel) -> Result<Obj> {
    let parsed = read(bytes, cancel);
    // Files that end early have faults.
    cancel.check()?;
    parsed.map_err(|Fault { line, message }| Error::Format {
        path: path.to_owned(),
        line,
        message,
    })
}

/// Triangles of a file, or its first fault.
fn read(bytes: &[u8], cancel: &Cancel) -> std::result::Result<Obj, Fault> {
    let text = decode(bytes)?;

    // Names stay with the reader, and so tobj finds one model and asks for no material.
    let mut reader = Reader::new(statements(&text), cancel);
    let no_materials = |_: &Path| Err(LoadError::OpenFileFailed);
    let mesh = match tobj::load_obj_buf(&mut reader, &tobj::LoadOptions::default(), no_materials) {
        Ok((mut models, _)) => models.swap_remove(0).mesh,
        Err(error) => return Err(fault::of_tobj(error, &text, reader.line)),
    };

    // Number the vertices as in the file: the last face says which number each of them has got.
    let mut corners = mesh.indices;
    let numbers = corners.split_off(corners.len() - reader.num_vertices);
    let positions: &[[f64; 3]] = mesh.positions.as_chunks().0;
    let vertices: Vec<[f64; 3]> = numbers.iter().map(|&number| positions[number as usize]).collect();
    let mut in_file = vec![0; vertices.len()];
    for (vertex, number) in numbers.into_iter().enumerate() {
        in_file[number as usize] = vertex as u32;
    }
    for corner in &mut corners {
        *corner = in_file[*corner as usize];
    }
    let is_far = |vertex: &[f64; 3]| !vertex.iter().all(|x| x.abs() < LARGEST);
    if let Some(number) = vertices.iter().position(is_far) {
        let expected = format!("finite numbers between -{LARGEST:e} and {LARGEST:e}");
        return Err(fault::in_vertex(&text, number, &expected));
    }

    // Cut the faces into triangles; each inherits the names of its face.
    let mut obj = Obj {
        vertices,
        ..Obj::default()
    };
    let names = [reader.objects, reader.groups, reader.materials];
    let mut corners = corners.as_slice();
    for face in 0..names[0].of_face.len() {
        if cancel.is_asked() {
            return Err(fault::at_end("", "the rest of the file"));
        }
        // tobj gives no numbers of corners where all are 3.
        let num_corners = mesh.face_arities.get(face).map_or(3, |&number| number as usize);
        let (polygon, rest) = corners.split_at(num_corners);
        corners = rest;
        if num_corners < 3 {
            return Err(fault::in_face(&text, face, "at least 3 corners"));
        }
        let num_triangles = obj
            .add_triangles(polygon)
            .map_err(|expected| fault::in_face(&text, face, &expected))?;
        for (part, names) in [&mut obj.object, &mut obj.group, &mut obj.material]
            .into_iter()
            .zip(&names)
        {
            part.extend(std::iter::repeat_n(names.of_face[face], num_triangles));
        }
    }
    if obj.triangles.is_empty() {
        return Err(fault::at_end(&text, "faces that have an area"));
    }
    [obj.object_names, obj.group_names, obj.material_names] = names.map(|names| names.list);
    Ok(obj)
}

impl Obj {
    /// Add the triangles of one face. Returns their number.
    fn add_triangles(&mut self, corners: &[u32]) -> std::result::Result<usize, String> {
        if let &[a, b, c] = corners {
            self.triangles.push([a, b, c]);
            return Ok(1);
        }
        let at = |&corner: &u32| DVec3::from(self.vertices[corner as usize]);
        let polygon: Vec<DVec3> = corners.iter().map(at).collect();
        let triangles = triangulate(&polygon)?;
        let num_triangles = triangles.len();
        let named = |triangle: [u32; 3]| triangle.map(|corner| corners[corner as usize]);
        self.triangles.extend(triangles.into_iter().map(named));
        Ok(num_triangles)
    }
}
