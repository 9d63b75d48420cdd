//! Stanford PLY: triangles with normals and texture coordinates, binary, little endian.
//!
//! Numbers are single precision and properties have the names that Mitsuba 3 looks for.

use super::OutputError;
use crate::geometry::{Point3, Vector3};

/// Triangles to be encoded; `normals` and `texcoords` are one a vertex.
#[derive(Clone, Copy, Debug)]
pub struct PlyMesh<'a> {
    /// Vertices [m].
    pub positions: &'a [Point3],
    /// Unit normals at the vertices.
    pub normals: &'a [Vector3],
    /// Texture coordinates (u, v) of the vertices.
    pub texcoords: &'a [[f64; 2]],
    /// Vertices of each triangle, counter-clockwise seen from the front.
    pub triangles: &'a [[u32; 3]],
}

/// A mesh as a PLY file.
///
/// # Errors
/// [`OutputError::Format`] when the counts disagree, a triangle has no vertex, or a number does not fit
/// single precision.
pub fn encode_ply(mesh: &PlyMesh<'_>) -> Result<Vec<u8>, OutputError> {
    let refuse =
        |why: String| Err(OutputError::Format(format!("a PLY file cannot hold this: {why}")));
    let count = mesh.positions.len();
    for (given, what) in
        [(mesh.normals.len(), "normals"), (mesh.texcoords.len(), "texture coordinates")]
    {
        if given != count {
            return refuse(format!("{given} {what} for {count} vertices"));
        }
    }
    // Indices are signed there.
    if i32::try_from(count).is_err() {
        return refuse(format!("{count} vertices"));
    }
    if let Some(v) = mesh.triangles.iter().flatten().find(|v| **v as usize >= count) {
        return refuse(format!("a triangle refers to vertex {v} of {count}"));
    }
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n\
         property float x\nproperty float y\nproperty float z\n\
         property float nx\nproperty float ny\nproperty float nz\n\
         property float u\nproperty float v\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.triangles.len()
    );
    let mut bytes = Vec::with_capacity(header.len() + 32 * count + 13 * mesh.triangles.len());
    bytes.extend(header.as_bytes());
    for (i, ((x, n), uv)) in mesh.positions.iter().zip(mesh.normals).zip(mesh.texcoords).enumerate()
    {
        for number in x.iter().chain(n.iter()).chain(uv) {
            let number = *number as f32;
            if !number.is_finite() {
                return refuse(format!("a number of vertex {i} is beyond single precision"));
            }
            bytes.extend(number.to_le_bytes());
        }
    }
    for triangle in mesh.triangles {
        bytes.push(3);
        for vertex in triangle {
            bytes.extend(vertex.to_le_bytes());
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_file_cannot_hold_is_refused() {
        let (points, up) = ([Point3::origin(); 3], [Vector3::z(); 3]);
        let mesh = PlyMesh {
            positions: &points,
            normals: &up,
            texcoords: &[[0.0; 2]; 3],
            triangles: &[[0, 1, 2]],
        };
        assert!(encode_ply(&mesh).is_ok());
        let far = [Point3::new(1e39, 0.0, 0.0); 3];
        for (wrong, says) in [
            (PlyMesh { normals: &up[..2], ..mesh }, "2 normals for 3"),
            (PlyMesh { texcoords: &[], ..mesh }, "0 texture"),
            (PlyMesh { triangles: &[[0, 1, 3]], ..mesh }, "vertex 3 of 3"),
            (PlyMesh { positions: &far, ..mesh }, "single precision"),
        ] {
            let message = encode_ply(&wrong).map(|_| ()).expect_err(says).to_string();
            assert!(message.contains(says), "{message}");
        }
    }
}
