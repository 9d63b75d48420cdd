//! OpenEXR with named layers.

use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, IntegerBounds,
    LayerAttributes, Text, WritableImage,
};

use super::{OutputError, Raster};

/// What the file says about itself beside its channels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExrAttributes {
    /// Attribute `scene`: the scene's name.
    pub scene: String,
    /// Attribute `units`: what the channels are measured in.
    pub units: String,
    /// Attribute `comments`: how the picture was made.
    pub comments: String,
}

/// All channels as 32-bit floats, losslessly compressed, row 0 at the top. Readers group channels by
/// the part of their name before the dot.
///
/// # Errors
/// [`OutputError::Format`] if the raster is malformed.
pub fn encode_exr(raster: Raster, attributes: &ExrAttributes) -> Result<Vec<u8>, OutputError> {
    raster.check()?;
    let failed = |e: exr::error::Error| OutputError::Format(format!("the EXR cannot be made: {e}"));
    let text = |s: &str| {
        // The format's text is a row of bytes; any character beyond Latin letters becomes `?`.
        let latin: String = s.chars().map(|c| if c.is_ascii() { c } else { '?' }).collect();
        Text::from(latin.as_str())
    };
    let mut layer = LayerAttributes {
        software_name: Some(text(concat!("evolute ", env!("CARGO_PKG_VERSION")))),
        comments: Some(text(&attributes.comments)),
        ..LayerAttributes::default()
    };
    // The crate keeps free attributes in two hash maps, of the layer and of the image, whose order
    // changes from run to run: one entry in each keeps the bytes the same.
    layer.other.insert(Text::from("units"), text_value(text(&attributes.units)));
    let size = (raster.width, raster.height);
    let channels = raster
        .channels
        .into_iter()
        .map(|c| AnyChannel::new(c.name.as_str(), FlatSamples::F32(c.values)))
        .collect();
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::FAST_LOSSLESS };
    let layer = exr::prelude::Layer::new(size, layer, encoding, AnyChannels::sort(channels));
    let mut image = Image::from_layer(layer);
    image.attributes.display_window = IntegerBounds::from_dimensions(size);
    image.attributes.other.insert(Text::from("scene"), text_value(text(&attributes.scene)));
    let mut bytes = std::io::Cursor::new(Vec::new());
    // Threads would write the blocks of lines in the order in which they happen to be ready.
    image.write().non_parallel().to_buffered(&mut bytes).map_err(failed)?;
    Ok(bytes.into_inner())
}

fn text_value(text: Text) -> exr::meta::attribute::AttributeValue {
    exr::meta::attribute::AttributeValue::Text(text)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use exr::prelude::*;

    fn sample() -> (Raster, ExrAttributes) {
        let mut raster = Raster::new(37, 321);
        let value = |i: usize, c: usize| (i * 3 + c) as f32 * 0.37 - 5.0;
        raster.push_rgb("", (0..37 * 321).map(move |i| [value(i, 0), value(i, 1), value(i, 2)]));
        raster.push_rgb("direct", (0..37 * 321).map(|i| [i as f32, 1e-30, 1e30]));
        raster.push("Z", (0..37 * 321).map(|i| i as f32).collect());
        let attributes = ExrAttributes {
            scene: "room".into(),
            units: "W/(m^2 sr)".into(),
            comments: "naïve".into(),
        };
        (raster, attributes)
    }

    #[test]
    fn reads_back() {
        let (raster, attributes) = sample();
        let bytes = encode_exr(raster.clone(), &attributes).unwrap();
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_buffered(std::io::Cursor::new(bytes))
            .unwrap();
        let layer = &image.layer_data[0];
        assert_eq!(layer.size, Vec2(37, 321));
        assert_eq!(layer.channel_data.list.len(), raster.channels.len());
        for channel in &layer.channel_data.list {
            let expected = raster.channel(&channel.name.to_string()).unwrap();
            let FlatSamples::F32(values) = &channel.sample_data else { panic!("not f32") };
            assert_eq!(values, expected);
        }
        let own = &layer.attributes;
        assert!(own.software_name.as_ref().unwrap().to_string().starts_with("evolute "));
        assert_eq!(own.comments, Some(Text::from("na?ve")));
        assert_eq!(own.other[&Text::from("units")], text_value(Text::from("W/(m^2 sr)")));
        assert_eq!(own.other[&Text::from("scene")], text_value(Text::from("room")));
    }

    #[test]
    fn same_bytes_every_time() {
        let (raster, attributes) = sample();
        let first = encode_exr(raster.clone(), &attributes).unwrap();
        for _ in 0..20 {
            assert!(encode_exr(raster.clone(), &attributes).unwrap() == first);
        }
    }
}
