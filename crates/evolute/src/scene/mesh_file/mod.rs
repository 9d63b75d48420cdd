//! Meshes from PLY and OBJ files.

mod obj;
mod ply;

use std::path::Path;

use crate::geometry::{Point3, Transform, Vector3, math};
use crate::surface::Mesh;

use super::describe::cannot_read;
use super::description::{Object, SceneDescription};
use super::load::find_file;
use super::message::{Checked, Complaint, quoted};
use super::source::read_bytes;

/// Longest mesh file [bytes]: a binary PLY of some ten million triangles. It is read at once.
const MAX_MESH_BYTES: u64 = 1 << 30;

/// A mesh as its file has it, object space.
#[derive(Debug, Default, PartialEq)]
struct RawMesh {
    positions: Vec<Point3>,
    triangles: Vec<[u32; 3]>,
    /// One a vertex, if the file has any.
    normals: Option<Vec<Vector3>>,
    /// One a vertex, if the file has any.
    texcoords: Option<Vec<[f64; 2]>>,
}

/// The mesh of an `obj` or `ply` shape, in world space, with Mitsuba 3's conventions: without
/// `face_normals` it has vertex normals, the file's or, if there are none, means over the adjacent
/// facets; texture coordinates of OBJ files are turned upside down unless `flip_tex_coords` says
/// otherwise, those of PLY files are not unless it says so.
pub(super) fn mesh(
    description: &SceneDescription,
    object: &Object,
    to_world: Transform,
    flip_normals: bool,
) -> Checked<Mesh> {
    let plugin = object.plugin.value.as_str();
    let name = object.string("filename")?.ok_or_else(|| {
        Complaint::at(object.span, format!("the shape {} needs a file", quoted(plugin)))
            .help(format!("write <string name=\"filename\" value=\"mesh.{plugin}\"/>"))
    })?;
    let face_normals = object.boolean("face_normals")?.unwrap_or(false);
    let flip_texcoords = object.boolean("flip_tex_coords")?.unwrap_or(plugin == "obj");

    let path = find_file(&description.sources, &description.folders, name)?;
    let bytes = read_bytes(&path, MAX_MESH_BYTES).map_err(|why| cannot_read(name, &path, &why))?;
    let raw = if plugin == "obj" { obj::read(&bytes) } else { ply::read(&bytes) };
    let refused = |path: &Path, why: String| {
        Complaint::at(
            name.span,
            format!("the mesh {} is not right: {why}", quoted(&path.to_string_lossy())),
        )
        .help("repair the file, or export it again")
    };
    let mut raw = raw.map_err(|why| refused(&path, why))?;
    drop(bytes);
    check_indices(&raw).map_err(|why| refused(&path, why))?;

    for p in &mut raw.positions {
        *p = to_world.point(p);
    }
    if flip_normals {
        for triangle in &mut raw.triangles {
            triangle.swap(1, 2);
        }
    }
    let side = if flip_normals { -1.0 } else { 1.0 };
    let normals = match raw.normals {
        _ if face_normals => None,
        Some(normals) => Some(normals.iter().map(|n| to_world.normal(n) * side).collect()),
        None => Some(mean_normals(&raw.positions, &raw.triangles)),
    };
    if flip_texcoords {
        for [_, v] in raw.texcoords.iter_mut().flatten() {
            *v = 1.0 - *v;
        }
    }
    Mesh::new(raw.positions, raw.triangles, normals, raw.texcoords)
        .map_err(|error| refused(&path, error.to_string()))
}

/// Every index has its vertex, every coordinate is a number: checked here, before anything is
/// computed with them, so that the message counts as the file does.
fn check_indices(raw: &RawMesh) -> Result<(), String> {
    let count = raw.positions.len();
    if let Some(i) = raw.positions.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(format!("vertex {i} has a coordinate that is not a finite number"));
    }
    for (i, triangle) in raw.triangles.iter().enumerate() {
        if let Some(vertex) = triangle.iter().find(|v| **v as usize >= count) {
            return Err(format!(
                "triangle {i} refers to vertex {vertex}, but there are {count} vertices, counted from 0"
            ));
        }
    }
    Ok(())
}

/// Vertex normals: facet normals weighted by the facet's angle at the vertex (Thürmer and Wüthrich,
/// "Computing Vertex Normals from Polygonal Facets", 1998), as Mitsuba 3 does. A vertex without
/// facets gets zero, which nothing asks for.
fn mean_normals(positions: &[Point3], triangles: &[[u32; 3]]) -> Vec<Vector3> {
    let mut normals = vec![Vector3::zeros(); positions.len()];
    for triangle in triangles {
        let corner = triangle.map(|v| positions[v as usize]);
        let across = (corner[1] - corner[0]).cross(&(corner[2] - corner[0]));
        let Some(normal) = across.try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite()))
        else {
            continue;
        };
        for i in 0..3 {
            let a = corner[(i + 1) % 3] - corner[i];
            let b = corner[(i + 2) % 3] - corner[i];
            let angle = math::atan2(a.cross(&b).norm(), a.dot(&b));
            if angle.is_finite() {
                normals[triangle[i] as usize] += normal * angle;
            }
        }
    }
    // A sum that cancels keeps its few digits; length does not matter.
    normals.iter().map(|n| n.try_normalize(0.0).unwrap_or(*n)).collect()
}

/// Triangles of a polygon: a fan around its first vertex, as in Mitsuba 3.
fn fan(polygon: &[u32], triangles: &mut Vec<[u32; 3]>) {
    if let [first, rest @ ..] = polygon {
        triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mitsuba 3.9.1 on two triangles at an angle: its `vertex_normals`.
    #[test]
    fn mean_normals_are_mitsuba_s() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 1.0]];
        let normals = mean_normals(&positions.map(Point3::from), &[[0, 1, 2], [2, 1, 3]]);
        let expected = [
            [0.0, 0.0, 1.0],
            [-0.37048277, -0.37048277, 0.85175407],
            [-0.37048277, -0.37048277, 0.85175407],
            [-0.57735026, -0.57735026, 0.57735026],
        ];
        for (n, e) in normals.iter().zip(expected) {
            assert!((n - Vector3::from(e)).norm() < 1e-7, "{n:?} {e:?}");
        }
    }

    #[test]
    fn polygons_become_fans() {
        let mut triangles = Vec::new();
        fan(&[4, 5, 6, 7, 8], &mut triangles);
        assert_eq!(triangles, [[4, 5, 6], [4, 6, 7], [4, 7, 8]]);
        fan(&[1, 2], &mut triangles);
        assert_eq!(triangles.len(), 3);
    }
}
