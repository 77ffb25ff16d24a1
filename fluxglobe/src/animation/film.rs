//! Where the pictures of an animation go, told by the name of the output.

use std::path::Path;

use anyhow::Result;
use bytes::Bytes;

use super::encoder::{self, Container, Encoder};
use super::folder::Folder;
use super::shots::Shots;
use super::strip::Strip;
use crate::cli::RenderAnimation;

/// An animation being written.
pub(super) enum Film {
    /// A PNG file a picture.
    Folder(Folder),
    /// An animated PNG.
    Strip(Box<Strip>),
    /// What ffmpeg writes.
    Encoder(Box<Encoder>),
}

/// Can the output of the options be written? What is not there is told before anything is drawn.
pub(super) fn check(options: &RenderAnimation) -> Result<()> {
    let kind = extension(&options.globe.picture.output);
    match kind.as_deref().and_then(Container::named) {
        Some(container) => encoder::check(&options.ffmpeg, container),
        None => Ok(()),
    }
}

impl Film {
    /// Opens the output of the options.
    pub(super) fn open(options: &RenderAnimation, shots: &Shots) -> Result<Self> {
        let output = &options.globe.picture.output;
        match extension(output).as_deref() {
            Some("png" | "apng") => Ok(Self::Strip(Box::new(Strip::open(output, shots)?))),
            Some(name) => match Container::named(name) {
                Some(container) => {
                    let encoder = Encoder::start(&options.ffmpeg, container, output, shots)?;
                    Ok(Self::Encoder(Box::new(encoder)))
                }
                None => Ok(Self::Folder(Folder::open(output, shots)?)),
            },
            None => Ok(Self::Folder(Folder::open(output, shots)?)),
        }
    }

    /// Numbers of the pictures that are still to be drawn.
    pub(super) fn missing(&self, shots: &Shots) -> Result<Vec<u32>> {
        match self {
            Self::Folder(folder) => folder.missing(),
            Self::Strip(_) | Self::Encoder(_) => Ok((0..shots.count()).collect()),
        }
    }

    /// Takes the next picture.
    pub(super) async fn add(&mut self, number: u32, png: Bytes) -> Result<()> {
        match self {
            Self::Folder(folder) => folder.add(number, &png),
            Self::Strip(strip) => strip.add(&png),
            Self::Encoder(encoder) => encoder.add(&png).await,
        }
    }

    /// Ends the output; bytes written.
    pub(super) async fn finish(self) -> Result<u64> {
        match self {
            Self::Folder(folder) => folder.size_bytes(),
            Self::Strip(strip) => strip.finish(),
            Self::Encoder(encoder) => encoder.finish().await,
        }
    }

    /// Leaves nothing half-written behind; pictures in a folder stay, for the next run to go on from.
    pub(super) async fn abandon(self) {
        match self {
            Self::Folder(_) => (),
            Self::Strip(strip) => strip.abandon(),
            Self::Encoder(encoder) => encoder.abandon().await,
        }
    }
}

fn extension(path: &Path) -> Option<String> {
    let text = path.as_os_str().to_str()?;
    if text.ends_with(std::path::MAIN_SEPARATOR) || path.is_dir() {
        return None;
    }
    Some(path.extension()?.to_str()?.to_ascii_lowercase())
}
