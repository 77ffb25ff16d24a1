//! Is an answer the picture that was asked for? Looked at without decoding it, which would cost more than asking.

use anyhow::{Context as _, Result, ensure};

/// ISO/IEC 15948, 5.2.
const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
/// A first chunk of 13 bytes that says how large the picture is (11.2.2).
const HEADER: &[u8] = b"\0\0\0\x0dIHDR";
/// The last chunk, with its checksum (11.2.5).
const END: &[u8] = b"\0\0\0\0IEND\xaeB`\x82";

/// An error that says what the bytes are instead of a whole PNG of this size.
pub(super) fn check(body: &[u8], size_px: [u32; 2]) -> Result<()> {
    let rest = body.strip_prefix(SIGNATURE);
    let rest = rest.and_then(|rest| rest.strip_prefix(HEADER));
    let (sizes, _rest) = rest
        .and_then(<[u8]>::split_first_chunk::<8>)
        .context("the answer is no PNG")?;
    let (width, height) = sizes.split_at(4);
    let side = |bytes: &[u8]| {
        bytes
            .iter()
            .fold(0, |side, byte| (side << 8) | u32::from(*byte))
    };
    let found = [side(width), side(height)];
    ensure!(
        found == size_px,
        "the picture has {} x {} pixels instead of {} x {}",
        found[0],
        found[1],
        size_px[0],
        size_px[1]
    );
    ensure!(body.ends_with(END), "the picture ends early");
    Ok(())
}

#[cfg(test)]
mod tests {
    use render::Image;

    use super::*;

    #[test]
    fn pictures_of_another_size_cut_ones_and_other_bytes_are_told() {
        let image = Image {
            width: 300,
            height: 2,
            rgba8: vec![9; 300 * 2 * 4],
        };
        let png = image.encode_png().unwrap();
        check(&png, [300, 2]).unwrap();
        let said = |body: &[u8], size_px| check(body, size_px).unwrap_err().to_string();
        assert!(said(&png, [2, 300]).contains("300 x 2 pixels instead of 2 x 300"));
        assert!(said(&png[..png.len() - 1], [300, 2]).contains("ends early"));
        for other in [&b""[..], b"{\"error\":\"busy\"}", &png[..20]] {
            assert!(said(other, [300, 2]).contains("no PNG"));
        }
    }
}
