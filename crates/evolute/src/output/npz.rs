//! NumPy's array files: one array (`.npy`), or several in an uncompressed zip archive (`.npz`).
//!
//! After NEP 1 (format version 1.0) and PKWARE's APPNOTE; dates are the zip format's first day, so
//! that the same arrays give the same bytes.

use super::OutputError;

/// A named array, its last index running fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Its key in the archive.
    pub name: String,
    /// Length along each axis.
    pub shape: Vec<usize>,
    /// The values.
    pub data: ArrayData,
}

/// The kinds of values.
#[derive(Clone, Debug, PartialEq)]
pub enum ArrayData {
    /// `<f8`
    F64(Vec<f64>),
    /// `<f4`
    F32(Vec<f32>),
    /// `<U…`: each text padded to the longest.
    Text(Vec<String>),
}

impl ArrayData {
    fn len(&self) -> usize {
        match self {
            Self::F64(v) => v.len(),
            Self::F32(v) => v.len(),
            Self::Text(v) => v.len(),
        }
    }

    /// Type in NumPy's notation, and the values' bytes.
    fn encode(&self) -> (String, Vec<u8>) {
        match self {
            Self::F64(v) => ("<f8".into(), v.iter().flat_map(|x| x.to_le_bytes()).collect()),
            Self::F32(v) => ("<f4".into(), v.iter().flat_map(|x| x.to_le_bytes()).collect()),
            Self::Text(v) => {
                // NumPy has no texts of length 0.
                let width = v.iter().map(|s| s.chars().count()).max().unwrap_or(0).max(1);
                let mut bytes = Vec::with_capacity(4 * width * v.len());
                for s in v {
                    let end = bytes.len() + 4 * width;
                    bytes.extend(s.chars().flat_map(|c| u32::from(c).to_le_bytes()));
                    bytes.resize(end, 0);
                }
                (format!("<U{width}"), bytes)
            }
        }
    }
}

/// One array as an `.npy` file (its name is not stored).
///
/// # Errors
/// [`OutputError::Format`] if shape and number of values disagree.
pub fn encode_npy(array: &Array) -> Result<Vec<u8>, OutputError> {
    let count: usize = array.shape.iter().product();
    if count != array.data.len() {
        return Err(OutputError::Format(format!(
            "array '{}' has {} values; its shape {:?} needs {count}",
            array.name,
            array.data.len(),
            array.shape
        )));
    }
    let (kind, data) = array.data.encode();
    let shape = match array.shape.as_slice() {
        [n] => format!("({n},)"),
        many => format!("({})", many.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    };
    let mut header =
        format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}").into_bytes();
    // Magic, version, length of the header, the header and its line end fill a multiple of 64 bytes.
    let total = (10 + header.len() + 1).next_multiple_of(64);
    header.resize(total - 11, b' ');
    header.push(b'\n');
    let length = u16::try_from(header.len())
        .map_err(|_| OutputError::Format(format!("array '{}' has too many axes", array.name)))?;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(length.to_le_bytes());
    bytes.extend(header);
    bytes.extend(data);
    Ok(bytes)
}

/// Arrays as an `.npz` archive: `numpy.load(…)["name"]`.
///
/// # Errors
/// [`OutputError::Format`] if an array is malformed, a name occurs twice, or the archive would need
/// more than 4 GiB.
pub fn encode_npz(arrays: &[Array]) -> Result<Vec<u8>, OutputError> {
    let large = || OutputError::Format("an .npz file cannot hold more than 4 GiB".into());
    let u32_of = |n: usize| u32::try_from(n).map_err(|_| large());
    let mut bytes = Vec::new();
    let mut directory = Vec::new();
    for (i, array) in arrays.iter().enumerate() {
        if arrays[..i].iter().any(|other| other.name == array.name) {
            return Err(OutputError::Format(format!("two arrays are called '{}'", array.name)));
        }
        let file = encode_npy(array)?;
        let name = format!("{}.npy", array.name);
        let name_length = u16::try_from(name.len())
            .map_err(|_| OutputError::Format(format!("the name '{name}' is too long")))?;
        let offset = u32_of(bytes.len())?;
        let size = u32_of(file.len())?;
        // What the local header and the directory have in common: version 2.0, names in UTF-8
        // (bit 11), stored, 1980-01-01 00:00, checksum, sizes, lengths of name and extra field.
        let mut common = Vec::with_capacity(26);
        for x in [20u16, 0x0800, 0, 0, 0x0021] {
            common.extend(x.to_le_bytes());
        }
        for x in [crc32(&file), size, size] {
            common.extend(x.to_le_bytes());
        }
        common.extend(name_length.to_le_bytes());
        common.extend([0, 0]);
        bytes.extend(b"PK\x03\x04");
        bytes.extend(&common);
        bytes.extend(name.as_bytes());
        bytes.extend(file);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        // No comment, disk 0, no attributes.
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let count = u16::try_from(arrays.len()).map_err(|_| large())?;
    let start = u32_of(bytes.len())?;
    let length = u32_of(directory.len())?;
    bytes.extend(directory);
    bytes.extend(b"PK\x05\x06\x00\x00\x00\x00");
    bytes.extend(count.to_le_bytes());
    bytes.extend(count.to_le_bytes());
    bytes.extend(length.to_le_bytes());
    bytes.extend(start.to_le_bytes());
    bytes.extend([0, 0]);
    Ok(bytes)
}

/// The checksum of zip archives (ISO 3309, reflected polynomial 0xEDB88320).
fn crc32(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 256] = {
        let mut table = [0; 256];
        let mut i = 0;
        while i < 256 {
            let mut c = i as u32;
            let mut bit = 0;
            while bit < 8 {
                c = if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
                bit += 1;
            }
            table[i] = c;
            i += 1;
        }
        table
    };
    !bytes.iter().fold(!0, |c, b| TABLE[((c ^ u32::from(*b)) & 0xff) as usize] ^ (c >> 8))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn checksum_of_the_standard_example() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
    }

    fn u16_at(b: &[u8], i: usize) -> usize {
        u16::from_le_bytes(b[i..i + 2].try_into().unwrap()) as usize
    }

    fn u32_at(b: &[u8], i: usize) -> usize {
        u32::from_le_bytes(b[i..i + 4].try_into().unwrap()) as usize
    }

    /// Reads an archive through its directory, as unzip does: names and contents.
    fn unzip(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
        let end = bytes.len() - 22;
        assert_eq!(&bytes[end..end + 4], b"PK\x05\x06");
        let mut at = u32_at(bytes, end + 16);
        assert_eq!(at + u32_at(bytes, end + 12), end);
        let mut files = Vec::new();
        for _ in 0..u16_at(bytes, end + 10) {
            assert_eq!(&bytes[at..at + 4], b"PK\x01\x02");
            let (crc, size) = (u32_at(bytes, at + 16), u32_at(bytes, at + 24));
            let name_length = u16_at(bytes, at + 28);
            let name = String::from_utf8(bytes[at + 46..at + 46 + name_length].to_vec()).unwrap();
            let local = u32_at(bytes, at + 42);
            assert_eq!(&bytes[local..local + 4], b"PK\x03\x04");
            assert_eq!(bytes[local + 4..local + 30], bytes[at + 6..at + 32]);
            let start = local + 30 + u16_at(bytes, local + 26) + u16_at(bytes, local + 28);
            let content = bytes[start..start + size].to_vec();
            assert_eq!(crc32(&content) as usize, crc);
            files.push((name, content));
            at += 46 + name_length;
        }
        files
    }

    #[test]
    fn reads_back() {
        let arrays = [
            Array {
                name: "direct".into(),
                shape: vec![2, 3],
                data: ArrayData::F64(vec![0.1, -2.0, 3e300, f64::NAN, 5.0, 6.0]),
            },
            Array { name: "error".into(), shape: vec![1], data: ArrayData::F32(vec![0.5]) },
            Array {
                name: "label".into(),
                shape: vec![2],
                data: ArrayData::Text(vec!["á".into(), "desk".into()]),
            },
        ];
        let files = unzip(&encode_npz(&arrays).unwrap());
        let names: Vec<_> = files.iter().map(|f| f.0.as_str()).collect();
        assert_eq!(names, ["direct.npy", "error.npy", "label.npy"]);
        let npy = &files[0].1;
        let data = 10 + u16_at(npy, 8);
        assert_eq!(data % 64, 0);
        let header = std::str::from_utf8(&npy[10..data]).unwrap();
        assert!(header.starts_with("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }"));
        assert!(header.ends_with('\n'));
        let values: Vec<u64> =
            npy[data..].chunks(8).map(|b| u64::from_le_bytes(b.try_into().unwrap())).collect();
        let ArrayData::F64(expected) = &arrays[0].data else { panic!() };
        assert_eq!(values, expected.iter().map(|x| x.to_bits()).collect::<Vec<_>>());
        let label = &files[2].1;
        assert_eq!(label.len() - (10 + u16_at(label, 8)), 2 * 4 * 4);
    }

    #[test]
    fn wrong_arrays_are_refused() {
        let array =
            Array { name: "a".into(), shape: vec![2], data: ArrayData::F64(vec![1.0, 2.0]) };
        assert!(encode_npz(&[array.clone(), array.clone()]).is_err());
        assert!(encode_npy(&Array { shape: vec![3], ..array }).is_err());
    }
}
