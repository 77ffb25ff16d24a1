//! As which bytes a picture travels.

use crate::error::ContractError;

/// Worst and best quality of a JPEG, of the scale that its encoders share.
pub const JPEG_QUALITIES: std::ops::RangeInclusive<u8> = 1..=100;

/// As which bytes a picture travels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum Encoding {
    /// Lossless, with alpha: what is stored, and what a job's name stands for.
    #[default]
    Png,
    /// Small and quick, for pictures that are looked at for a moment: never stored. What is transparent is black.
    Jpeg {
        /// Of [`JPEG_QUALITIES`].
        quality: u8,
    },
}

impl Encoding {
    /// A JPEG of a quality.
    ///
    /// # Errors
    /// A quality outside of [`JPEG_QUALITIES`].
    pub fn jpeg(quality: u8) -> Result<Self, ContractError> {
        if JPEG_QUALITIES.contains(&quality) {
            Ok(Self::Jpeg { quality })
        } else {
            let valid = "a whole number, 1 to 100";
            Err(ContractError::invalid(
                "JPEG quality",
                &quality.to_string(),
                valid,
            ))
        }
    }

    /// Its name on the web (RFC 2046; PNG: W3C; JPEG: RFC 2045).
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Png => "image/png",
            Self::Jpeg { .. } => "image/jpeg",
        }
    }

    /// May a picture in it be stored under the name of its job?
    pub fn is_stored(self) -> bool {
        self == Self::Png
    }
}
