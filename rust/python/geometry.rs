//! Files of meshes.

use std::path::PathBuf;

use numpy::IntoPyArray;
use pyo3::prelude::*;

use super::arrays::matrix;
use super::threads::compute_owned;
use crate::geometry::obj::read_obj;

/// Vertices, triangles and, for objects, groups and materials, the number per triangle and the names.
#[pyfunction]
pub(super) fn load_obj(py: Python<'_>, path: PathBuf) -> PyResult<impl IntoPyObject<'_>> {
    let obj = compute_owned(py, None, move |cancel| read_obj(&path, cancel))?;
    let parts = [
        (obj.object, obj.object_names),
        (obj.group, obj.group_names),
        (obj.material, obj.material_names),
    ];
    let parts = parts.map(|(numbers, names)| (numbers.into_pyarray(py), names));
    Ok((matrix(py, obj.vertices)?, matrix(py, obj.triangles)?, Vec::from(parts)))
}
