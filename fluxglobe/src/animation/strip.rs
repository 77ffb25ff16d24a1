//! An animation as one animated PNG: full colour and alpha, shown by browsers, no encoder needed.

use std::fs::File;
use std::io::{BufWriter, Cursor};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use png::{BitDepth, ColorType, Compression, Decoder, Encoder, Writer};

use super::shots::Shots;

/// An animated PNG being written.
pub(super) struct Strip {
    writer: Writer<BufWriter<File>>,
    size_px: [u32; 2],
    begun: PathBuf,
    done: PathBuf,
}

impl Strip {
    pub(super) fn open(path: &Path, shots: &Shots) -> Result<Self> {
        let begun = super::encoder::begun(path)?;
        let file =
            File::create(&begun).with_context(|| format!("cannot write {}", begun.display()))?;
        let size_px = shots.view.size_px();
        let mut encoder = Encoder::new(BufWriter::new(file), size_px[0], size_px[1]);
        encoder.set_color(ColorType::Rgba);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_compression(Compression::Balanced);
        // 0 repetitions are endless ones.
        encoder.set_animated(shots.count(), 0)?;
        encoder.set_frame_delay(1, shots.fps)?;
        Ok(Self {
            writer: encoder.write_header()?,
            size_px,
            begun,
            done: path.to_owned(),
        })
    }

    pub(super) fn add(&mut self, picture: &[u8]) -> Result<()> {
        let mut reader = Decoder::new(Cursor::new(picture)).read_info()?;
        let info = reader.info();
        let kind = (info.color_type, info.bit_depth);
        if [info.width, info.height] != self.size_px || kind != (ColorType::Rgba, BitDepth::Eight) {
            bail!("a picture came in another size or kind than was asked for");
        }
        let bytes = self.size_px[0] as usize * self.size_px[1] as usize * 4;
        let mut pixels = vec![0; bytes];
        reader.next_frame(&mut pixels)?;
        self.writer.write_image_data(&pixels)?;
        Ok(())
    }

    pub(super) fn finish(self) -> Result<u64> {
        self.writer.finish()?;
        std::fs::rename(&self.begun, &self.done)
            .with_context(|| format!("cannot write {}", self.done.display()))?;
        Ok(std::fs::metadata(&self.done)?.len())
    }

    pub(super) fn abandon(self) {
        drop(self.writer);
        super::encoder::remove(&self.begun);
    }
}
