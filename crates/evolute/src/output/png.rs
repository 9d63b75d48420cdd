//! PNG, 8 bits a channel, sRGB.

use super::{Exposure, OutputError, Raster, display_rgb};

/// The picture's unnamed layer `R`, `G`, `B` as an sRGB PNG at the given exposure.
///
/// # Errors
/// [`OutputError::Format`] if the raster has no such layer or is malformed.
pub fn encode_png(raster: &Raster, exposure: Exposure) -> Result<Vec<u8>, OutputError> {
    raster.check()?;
    let format = |text: String| OutputError::Format(text);
    let [r, g, b] =
        raster.rgb("").ok_or_else(|| format("the picture has no channels R, G, B".into()))?;
    let factor = exposure.factor();
    let mut pixels = Vec::with_capacity(3 * r.len());
    for i in 0..r.len() {
        pixels.extend(display_rgb([r[i], g[i], b[i]].map(|x| f64::from(x) * factor)));
    }
    let size = |n: usize| u32::try_from(n).map_err(|_| format("the picture is too large".into()));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size(raster.width)?, size(raster.height)?);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let failed = |e: png::EncodingError| format(format!("the PNG cannot be encoded: {e}"));
    encoder
        .add_text_chunk("Software".into(), concat!("evolute ", env!("CARGO_PKG_VERSION")).into())
        .map_err(failed)?;
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&pixels).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn reads_back() {
        let mut raster = Raster::new(2, 1);
        raster.push_rgb("", [[0.0, 0.2159, 0.1], [4.0, 2.0, 0.0]].into_iter());
        let bytes = encode_png(&raster, Exposure { ev: -1.0 }).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        assert_eq!((reader.info().width, reader.info().height), (2, 1));
        assert_eq!(reader.info().srgb, Some(png::SrgbRenderingIntent::Perceptual));
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels[..3], display_rgb([0.0, 0.10795, 0.05]));
        assert_eq!(pixels[3..6], display_rgb([2.0, 1.0, 0.0]));
    }

    #[test]
    fn malformed_rasters_are_refused() {
        let mut raster = Raster::new(2, 1);
        assert!(encode_png(&raster, Exposure { ev: 0.0 }).is_err());
        raster.push("R", vec![0.0; 3]);
        let text = encode_png(&raster, Exposure { ev: 0.0 }).unwrap_err().to_string();
        assert!(text.contains("'R' has 3 values"), "{text}");
    }
}
