//! Radiance's picture format (`.hdr`): RGBE with run-length encoded scanlines.
//!
//! After the description of the format in G. Ward, "Real Pixels" (Graphics Gems II, 1991) and the file
//! format pages of Radiance. Values are W/(m² sr), as Radiance means them.

use super::{OutputError, Raster};

/// Runs shorter than this cost more than they save.
const MIN_RUN: usize = 4;

/// The unnamed layer `R`, `G`, `B`. Each pixel keeps about 1 % of its largest channel; negative and
/// undefined values become 0.
///
/// # Errors
/// [`OutputError::Format`] if the raster has no such layer or is malformed.
pub fn encode_radiance(raster: &Raster) -> Result<Vec<u8>, OutputError> {
    raster.check()?;
    let Some([r, g, b]) = raster.rgb("") else {
        return Err(OutputError::Format("the picture has no channels R, G, B".into()));
    };
    let (width, height) = (raster.width, raster.height);
    let mut bytes = format!(
        "#?RADIANCE\nSOFTWARE=evolute {}\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n",
        env!("CARGO_PKG_VERSION")
    )
    .into_bytes();
    for y in 0..height {
        let row = y * width..(y + 1) * width;
        let pixels: Vec<[u8; 4]> = row.map(|i| rgbe([r[i], g[i], b[i]])).collect();
        // The new run-length encoding exists for these widths only.
        if (8..=0x7fff).contains(&width) {
            bytes.extend([2, 2, (width >> 8) as u8, (width & 0xff) as u8]);
            for component in 0..4 {
                let line: Vec<u8> = pixels.iter().map(|p| p[component]).collect();
                encode_line(&line, &mut bytes);
            }
        } else {
            bytes.extend(pixels.iter().flatten());
        }
    }
    Ok(bytes)
}

/// Mantissas and the exponent they share.
fn rgbe(rgb: [f32; 3]) -> [u8; 4] {
    let rgb = rgb.map(|x| if x.is_nan() { 0.0 } else { f64::from(x.clamp(0.0, 1e38)) });
    let largest = rgb[0].max(rgb[1]).max(rgb[2]);
    // Radiance's own limit of what counts as black.
    if largest <= 1e-32 {
        return [0; 4];
    }
    let (_, exponent) = libm::frexp(largest);
    let scale = libm::ldexp(1.0, 8 - exponent);
    let [r, g, b] = rgb.map(|x| (x * scale) as u8);
    [r, g, b, (exponent + 128).clamp(0, 255) as u8]
}

/// One component of one scanline: runs as (128 + length, value), the rest as (length, values).
fn encode_line(line: &[u8], out: &mut Vec<u8>) {
    let mut at = 0;
    while at < line.len() {
        // The next run worth encoding, and the literal stretch before it.
        let mut start = at;
        let mut length = 0;
        while start < line.len() {
            length = line[start..].iter().take(127).take_while(|b| **b == line[start]).count();
            if length >= MIN_RUN {
                break;
            }
            start += length;
        }
        for chunk in line[at..start].chunks(128) {
            out.push(chunk.len() as u8);
            out.extend(chunk);
        }
        if start < line.len() {
            out.extend([128 + length as u8, line[start]]);
            at = start + length;
        } else {
            at = start;
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// An independent reader: returns width, height and linear values.
    fn decode(bytes: &[u8]) -> (usize, usize, Vec<[f64; 3]>) {
        let header = bytes.windows(2).position(|w| w == b"\n\n").unwrap() + 2;
        let end = header + bytes[header..].iter().position(|b| *b == b'\n').unwrap();
        let line = std::str::from_utf8(&bytes[header..end]).unwrap();
        let words: Vec<&str> = line.split(' ').collect();
        let (h, w): (usize, usize) = (words[1].parse().unwrap(), words[3].parse().unwrap());
        let mut data = bytes[end + 1..].iter().copied();
        let mut pixels = Vec::new();
        for _ in 0..h {
            let mut row = vec![[0u8; 4]; w];
            if (8..=0x7fff).contains(&w) {
                assert_eq!((data.next(), data.next()), (Some(2), Some(2)));
                let stated = data.next().unwrap() as usize * 256 + data.next().unwrap() as usize;
                assert_eq!(stated, w);
                for c in 0..4 {
                    let mut x = 0;
                    while x < w {
                        let n = data.next().unwrap() as usize;
                        assert!(n > 0);
                        let run = n > 128;
                        let value = run.then(|| data.next().unwrap());
                        for _ in 0..if run { n - 128 } else { n } {
                            row[x][c] = value.unwrap_or_else(|| data.next().unwrap());
                            x += 1;
                        }
                    }
                }
            } else {
                row.iter_mut().flatten().for_each(|b| *b = data.next().unwrap());
            }
            pixels.extend(row.iter().map(|p| {
                let scale = if p[3] == 0 { 0.0 } else { libm::ldexp(1.0, i32::from(p[3]) - 136) };
                [0, 1, 2].map(|c| if p[3] == 0 { 0.0 } else { (f64::from(p[c]) + 0.5) * scale })
            }));
        }
        assert_eq!(data.next(), None);
        (w, h, pixels)
    }

    #[test]
    fn reads_back() {
        for (w, h) in [(300, 3), (5, 2)] {
            let mut raster = Raster::new(w, h);
            let value = |i: usize| {
                // Flat stretches, ramps, blacks and a large range.
                let x = if i % 97 < 40 { 0.25 } else { (i % 31) as f32 * 0.11 };
                let big = if i.is_multiple_of(50) { 1e6 } else { 1.0 };
                if i % 60 < 6 { [0.0; 3] } else { [x * big, 0.5 * x + 0.01, 1e-9] }
            };
            raster.push_rgb("", (0..w * h).map(value));
            let (dw, dh, pixels) = decode(&encode_radiance(&raster).unwrap());
            assert_eq!((dw, dh), (w, h));
            for (i, p) in pixels.iter().enumerate() {
                let v = value(i).map(f64::from);
                let largest = v[0].max(v[1]).max(v[2]);
                for c in 0..3 {
                    assert!((p[c] - v[c]).abs() <= largest / 250.0, "{i} {p:?} {v:?}");
                }
            }
        }
    }
}
