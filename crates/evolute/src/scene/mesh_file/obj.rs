//! Wavefront OBJ files: vertices, texture coordinates, normals and polygons; everything else in
//! them is passed over, as in Mitsuba 3.
//!
//! Read here and not by a crate: the messages name the line, coordinates stay doubles, and all
//! groups become one mesh.

use std::collections::HashMap;

use super::{RawMesh, fan};
use crate::geometry::{Point3, Vector3};

/// A corner of a polygon: indices of its position, texture coordinates and normal.
type Corner = (u32, Option<u32>, Option<u32>);

/// Reads a file.
///
/// # Errors
/// A clause that says what is wrong with it, and in which line.
pub(super) fn read(bytes: &[u8]) -> Result<RawMesh, String> {
    let mut reader = ObjReader::default();
    for (i, line) in bytes.split(|b| *b == b'\n').enumerate() {
        let line = String::from_utf8_lossy(line);
        let line = line.split('#').next().unwrap_or("");
        reader.line(line).map_err(|why| format!("line {}: {why}", i + 1))?;
    }
    Ok(reader.mesh())
}

/// What has been read.
#[derive(Default)]
struct ObjReader {
    positions: Vec<[f64; 3]>,
    texcoords: Vec<[f64; 2]>,
    normals: Vec<[f64; 3]>,
    /// Every combination of indices that occurs becomes a vertex, in the order of the file. (Only
    /// looked up, never iterated.)
    vertices: HashMap<Corner, u32>,
    corners: Vec<Corner>,
    triangles: Vec<[u32; 3]>,
    polygon: Vec<u32>,
}

impl ObjReader {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => self.positions.push(numbers(words)?),
            Some("vn") => self.normals.push(numbers(words)?),
            Some("vt") => self.texcoords.push(numbers(words)?),
            Some("f") => {
                self.polygon.clear();
                for word in words {
                    let vertex = self.vertex(word)?;
                    self.polygon.push(vertex);
                }
                if self.polygon.len() < 3 {
                    return Err(format!("a face with {} vertices", self.polygon.len()));
                }
                fan(&self.polygon, &mut self.triangles);
            }
            _ => {}
        }
        Ok(())
    }

    /// The vertex of a corner such as `3`, `3/1`, `3/1/2` or `3//2`.
    fn vertex(&mut self, word: &str) -> Result<u32, String> {
        let mut parts = word.splitn(3, '/');
        let mut index = |count: usize, what: &str| match parts.next() {
            None | Some("") => Ok(None),
            Some(text) => resolve(text, count, what).map(Some),
        };
        let position = index(self.positions.len(), "vertex")?;
        let texcoord = index(self.texcoords.len(), "texture coordinate")?;
        let normal = index(self.normals.len(), "normal")?;
        let position = position.ok_or_else(|| format!("a corner without a vertex: {word:.40}"))?;
        let corner = (position, texcoord, normal);
        if let Some(vertex) = self.vertices.get(&corner) {
            return Ok(*vertex);
        }
        let vertex = u32::try_from(self.corners.len()).map_err(|_| "too many vertices")?;
        self.vertices.insert(corner, vertex);
        self.corners.push(corner);
        Ok(vertex)
    }

    fn mesh(self) -> RawMesh {
        // Indices have been checked when they were read.
        let position = |c: &Corner| Point3::from(self.positions[c.0 as usize]);
        let texcoord = |c: &Corner| c.1.map(|i| self.texcoords[i as usize]);
        let normal = |c: &Corner| c.2.map(|i| Vector3::from(self.normals[i as usize]));
        RawMesh {
            positions: self.corners.iter().map(position).collect(),
            triangles: self.triangles,
            // All corners have them, or the mesh has none.
            normals: self.corners.iter().map(normal).collect(),
            texcoords: self.corners.iter().map(texcoord).collect(),
        }
    }
}

/// The first numbers of a line; further ones (weights, colours) are passed over.
fn numbers<'a, const N: usize>(
    mut words: impl Iterator<Item = &'a str>,
) -> Result<[f64; N], String> {
    let mut numbers = [0.0; N];
    for (i, number) in numbers.iter_mut().enumerate() {
        let word = words.next().ok_or_else(|| format!("{i} numbers where {N} are needed"))?;
        *number = word
            .parse()
            .ok()
            .filter(|x: &f64| x.is_finite())
            .ok_or_else(|| format!("\"{word:.40}\" is not a finite number"))?;
    }
    Ok(numbers)
}

/// The index, from 0, that a number from 1, or from −1 backwards, means.
fn resolve(text: &str, count: usize, what: &str) -> Result<u32, String> {
    let number: i64 = text.parse().map_err(|_| format!("\"{text:.40}\" is not an index"))?;
    let index = if number < 0 { count as i64 + number } else { number - 1 };
    u32::try_from(index)
        .ok()
        .filter(|i| (*i as usize) < count)
        .ok_or_else(|| format!("there is no {what} {number}: {count} come before this line"))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn corners_with_the_same_indices_are_one_vertex() {
        let text = "# a square\r\nmtllib x.mtl\no a\nv 0 0 0\r\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 .5\n\
            vt 0 0\nvt 1 0.25\nvn 0 0 1\ng b\nusemtl c\ns off\nf 1/1/1 2/2/1 3/1/1\nf -4/1/-1 3/1/1 4/1/1 # end";
        let mesh = read(text.as_bytes()).unwrap();
        assert_eq!(mesh.positions.len(), 4);
        assert_eq!(mesh.positions[3], Point3::new(0.0, 1.0, 0.5));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.texcoords.unwrap()[1], [1.0, 0.25]);
        assert_eq!(mesh.normals.unwrap()[0], Vector3::z());
    }

    #[test]
    fn data_that_some_corners_lack_is_left_out() {
        let mesh = read(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3").unwrap();
        assert_eq!((mesh.normals, mesh.texcoords), (None, None));
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
    }

    #[test]
    fn broken_files_are_refused_by_line() {
        for (text, line) in [
            ("v 0 0", 1),
            ("v 0 0 nan", 1),
            ("v 0 0 1e999", 1),
            ("v 0 0 x", 1),
            ("v 0 0 0\nf 1 1", 2),
            ("v 0 0 0\nf 1 1 2", 2),
            ("v 0 0 0\nf 1 1 0", 2),
            ("v 0 0 0\nf 1 1 -2", 2),
            ("v 0 0 0\nf 1 1 /1", 2),
            ("v 0 0 0\nf 1 1 1/1", 2),
            ("v 0 0 0\nf 1 1 99999999999999999999", 2),
        ] {
            let message = read(text.as_bytes()).unwrap_err();
            assert!(message.starts_with(&format!("line {line}: ")), "{text}: {message}");
        }
        assert_eq!(
            read(b"").unwrap(),
            RawMesh { normals: Some(vec![]), texcoords: Some(vec![]), ..Default::default() }
        );
        assert!(read(&[0xff, 0xfe, b'v', b' ']).is_ok(), "not text, nothing in it");
    }
}
