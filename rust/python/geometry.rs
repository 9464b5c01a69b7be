//! Files of meshes.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;

use super::arrays::matrix;
use super::threads::compute_owned;
use crate::geometry::obj::{Obj, read_obj};

pub(super) type ObjArrays<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<u32>>,
    Vec<(Bound<'py, PyArray1<u32>>, Vec<String>)>,
);

/// Vertices, triangles and, for objects, groups and materials, the number per triangle and the names.
#[pyfunction]
pub(super) fn load_obj(py: Python<'_>, path: PathBuf) -> PyResult<ObjArrays<'_>> {
    let Obj {
        vertices,
        triangles,
        object,
        group,
        material,
        object_names,
        group_names,
        material_names,
    } = compute_owned(py, None, move |cancel| read_obj(&path, cancel))?;
    let parts = [(object, object_names), (group, group_names), (material, material_names)];
    let parts = parts
        .into_iter()
        .map(|(numbers, names)| (numbers.into_pyarray(py), names))
        .collect();
    Ok((matrix(py, vertices)?, matrix(py, triangles)?, parts))
}
