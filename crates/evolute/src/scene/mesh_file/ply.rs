//! PLY files: text, and binary of both byte orders.

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};

use super::{RawMesh, fan};
use crate::geometry::{Point3, Vector3};

/// The numbers of a vertex that are used, by the names they go by.
const VERTEX: [&[&str]; 8] = [
    &["x"],
    &["y"],
    &["z"],
    &["nx"],
    &["ny"],
    &["nz"],
    &["u", "s", "texture_u"],
    &["v", "t", "texture_v"],
];

/// The names of a face's list of vertices.
const FACE: [&str; 2] = ["vertex_indices", "vertex_index"];

/// One vertex: position, normal, texture coordinates.
struct Vertex([f64; 8]);

/// One face.
#[derive(Default)]
struct Face {
    vertices: Vec<u32>,
    /// Whether an index was negative.
    negative: bool,
}

/// An element nobody asked for.
struct Skipped;

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([0.0; 8])
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let Some(slot) = VERTEX.iter().position(|names| names.contains(&name)) else {
            return PropertyAccessResult::Ignored;
        };
        let number = match property {
            Property::Float(x) => f64::from(x),
            Property::Double(x) => x,
            Property::Char(i) => f64::from(i),
            Property::UChar(i) => f64::from(i),
            Property::Short(i) => f64::from(i),
            Property::UShort(i) => f64::from(i),
            Property::Int(i) => f64::from(i),
            Property::UInt(i) => f64::from(i),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        self.0[slot] = number;
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !FACE.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        match &property {
            Property::ListChar(_)
            | Property::ListShort(_)
            | Property::ListInt(_)
            | Property::ListUChar(_)
            | Property::ListUShort(_)
            | Property::ListUInt(_) => {
                self.negative = true;
                if let Some(vertices) = property.to_u32_list() {
                    *self = Self { vertices, negative: false };
                }
                PropertyAccessResult::Set
            }
            _ => PropertyAccessResult::UnsupportedType,
        }
    }
}

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

/// Reads a file.
///
/// # Errors
/// A clause that says what is wrong with it.
pub(super) fn read(bytes: &[u8]) -> Result<RawMesh, String> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(first_line)?;
    check_sizes(&header, reader.get_ref().len() as u64)?;

    let mut mesh = RawMesh::default();
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                let has = |slot: usize| {
                    VERTEX[slot].iter().any(|name| element.properties.contains_key(*name))
                };
                if let Some(slot) = (0..3).find(|slot| !has(*slot)) {
                    return Err(format!("its vertices have no {}", VERTEX[slot][0]));
                }
                let vertices = Parser::<Vertex>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(first_line)?;
                let three = |v: &Vertex, i: usize| [v.0[i], v.0[i + 1], v.0[i + 2]];
                mesh.positions = vertices.iter().map(|v| Point3::from(three(v, 0))).collect();
                if (3..6).all(has) {
                    mesh.normals =
                        Some(vertices.iter().map(|v| Vector3::from(three(v, 3))).collect());
                }
                if (6..8).all(has) {
                    mesh.texcoords = Some(vertices.iter().map(|v| [v.0[6], v.0[7]]).collect());
                }
            }
            "face" => {
                if !FACE.iter().any(|name| element.properties.contains_key(*name)) {
                    return Err("its faces have no list \"vertex_indices\"".to_string());
                }
                let faces = Parser::<Face>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(first_line)?;
                for (i, face) in faces.iter().enumerate() {
                    if face.negative {
                        return Err(format!("face {i} refers to a vertex below 0"));
                    }
                    if face.vertices.len() < 3 {
                        return Err(format!(
                            "face {i} has {} vertices; a face needs three",
                            face.vertices.len()
                        ));
                    }
                    fan(&face.vertices, &mut mesh.triangles);
                }
            }
            _ => {
                Parser::<Skipped>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(first_line)?;
            }
        }
    }
    Ok(mesh)
}

/// Refuses headers that promise more than the file can hold, before anything is allocated for it.
fn check_sizes(header: &Header, available: u64) -> Result<(), String> {
    let mut needed = 0u64;
    for (name, element) in &header.elements {
        let least = least_size(element, header.encoding);
        if least == 0 && element.count > 0 {
            return Err(format!("its element \"{name}\" has no properties"));
        }
        needed = needed.saturating_add((element.count as u64).saturating_mul(least));
        // The last line of a text need not end.
        if needed.saturating_sub(1) > available {
            return Err(format!(
                "its header promises {} of \"{name}\", which with what comes before take {needed} bytes \
                 or more, but {available} follow: it is cut off, or its header is wrong",
                element.count
            ));
        }
    }
    Ok(())
}

/// Fewest bytes of one element.
fn least_size(element: &ElementDef, encoding: Encoding) -> u64 {
    let sizes = element.properties.values().map(|property| match (encoding, &property.data_type) {
        // A digit, and a blank or the end of the line.
        (Encoding::Ascii, _) => 2,
        (_, PropertyType::Scalar(scalar)) => scalar_size(scalar),
        (_, PropertyType::List(length, _)) => scalar_size(length),
    });
    sizes.sum()
}

fn scalar_size(scalar: &ScalarType) -> u64 {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// The parser's message has several lines with the file's text in them; the first says it.
fn first_line(error: ply_rs_bw::parser::ParseError) -> String {
    let text = error.to_string();
    let first: String = text.lines().next().unwrap_or("").chars().take(200).collect();
    match text.lines().find_map(|line| line.trim().strip_prefix("String: ")) {
        Some(what) => {
            let what: String = what.chars().take(60).filter(|c| !c.is_control()).collect();
            format!("{first} ({what})")
        }
        None => first,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const HEADER: &str = "ply\nformat FORMAT 1.0\ncomment by hand\nelement vertex 4\n\
        property float x\nproperty float y\nproperty double z\nproperty uchar red\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n";

    fn text() -> Vec<u8> {
        let body = "0 0 0 9\n1 0 0 9\n1 1 0.5 9\n0 1 0 9\n4 0 1 2 3\n";
        (HEADER.replace("FORMAT", "ascii") + body).into_bytes()
    }

    fn binary(big: bool) -> Vec<u8> {
        let format = if big { "binary_big_endian" } else { "binary_little_endian" };
        let mut bytes = HEADER.replace("FORMAT", format).into_bytes();
        let float = |x: f32| if big { x.to_be_bytes() } else { x.to_le_bytes() };
        let double = |x: f64| if big { x.to_be_bytes() } else { x.to_le_bytes() };
        let int = |x: i32| if big { x.to_be_bytes() } else { x.to_le_bytes() };
        for [x, y, z] in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5], [0.0, 1.0, 0.0]] {
            bytes.extend(float(x));
            bytes.extend(float(y));
            bytes.extend(double(f64::from(z)));
            bytes.push(9);
        }
        bytes.push(4);
        (0..4).for_each(|i| bytes.extend(int(i)));
        bytes
    }

    #[test]
    fn text_and_both_binaries_say_the_same() {
        let mesh = read(&text()).unwrap();
        assert_eq!(mesh.positions.len(), 4);
        assert_eq!(mesh.positions[2], Point3::new(1.0, 1.0, 0.5));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!((mesh.normals.as_ref(), mesh.texcoords.as_ref()), (None, None));
        assert_eq!(read(&binary(false)).unwrap(), mesh);
        assert_eq!(read(&binary(true)).unwrap(), mesh);
    }

    #[test]
    fn lying_headers_are_refused_before_anything_is_allocated() {
        for count in ["5", "4000000000", "18446744073709551615"] {
            for bytes in [text(), binary(false)] {
                let at = bytes.windows(9).position(|w| w == b"vertex 4\n").unwrap();
                let mut lying = bytes[..at].to_vec();
                lying.extend(format!("vertex {count}\n").bytes());
                lying.extend(&bytes[at + 9..]);
                assert!(read(&lying).is_err(), "{count}");
            }
        }
        let empty =
            "ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\nend_header\n";
        assert!(read(empty.as_bytes()).unwrap_err().contains("no properties"));
        // A list that says it has four thousand million entries.
        let mut list = binary(false);
        let at = list.windows(10).position(|w| w == b"list uchar").unwrap();
        list.splice(at..at + 10, *b"list uint ");
        let end = list.len();
        list.splice(end - 17..end - 16, [0xff; 4]);
        assert!(read(&list).is_err());
    }

    #[test]
    fn broken_files_are_refused_and_never_panic() {
        for bytes in [text(), binary(false), binary(true)] {
            for length in 0..bytes.len() - 1 {
                assert!(read(&bytes[..length]).is_err(), "{length}");
            }
            for i in 0..bytes.len() {
                for value in [0, b'9', b'-', b' ', b'\n', 0xff] {
                    let mut changed = bytes.clone();
                    changed[i] = value;
                    let _ = read(&changed);
                }
            }
        }
        assert!(read(b"").is_err());
        assert!(read(b"solid stl").is_err());
        let two = String::from_utf8(text()).unwrap().replace("4 0 1 2 3", "2 0 1");
        assert!(read(two.as_bytes()).unwrap_err().contains("needs three"));
        let negative = String::from_utf8(text()).unwrap().replace("4 0 1 2 3", "3 0 1 -2");
        assert!(read(negative.as_bytes()).unwrap_err().contains("below 0"));
    }
}
