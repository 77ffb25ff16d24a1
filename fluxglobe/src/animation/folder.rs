//! An animation as a folder of PNG files, which goes on where it was left.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use super::shots::Shots;

/// What is in the folder, so that no other animation is mixed into it.
const CONTENTS: &str = "animation.json";

/// A folder of pictures.
pub(super) struct Folder {
    path: PathBuf,
    count: u32,
}

impl Folder {
    /// Makes the folder, or opens it if it holds this animation.
    pub(super) fn open(path: &Path, shots: &Shots) -> Result<Self> {
        std::fs::create_dir_all(path)
            .with_context(|| format!("cannot make the folder {}", path.display()))?;
        let folder = Self {
            path: path.to_owned(),
            count: shots.count(),
        };
        let contents = path.join(CONTENTS);
        match std::fs::read(&contents) {
            Ok(bytes) => {
                let held: Option<Shots> = serde_json::from_slice(&bytes).ok();
                if held.as_ref() != Some(shots) {
                    bail!(
                        "{} holds another animation, or the product has changed since; choose another folder or remove that one",
                        path.display()
                    );
                }
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                folder.write(CONTENTS, &serde_json::to_vec_pretty(shots)?)?;
            }
            Err(error) => {
                return Err(error).with_context(|| format!("cannot read {}", contents.display()));
            }
        }
        Ok(folder)
    }

    fn name(number: u32) -> String {
        format!("picture-{number:05}.png")
    }

    /// Numbers of pictures that are not there. A file appears whole or not at all, so one that is there is done.
    pub(super) fn missing(&self) -> Result<Vec<u32>> {
        let mut missing = vec![];
        for number in 0..self.count {
            if !self.path.join(Self::name(number)).try_exists()? {
                missing.push(number);
            }
        }
        Ok(missing)
    }

    pub(super) fn add(&self, number: u32, png: &[u8]) -> Result<()> {
        self.write(&Self::name(number), png)
    }

    /// Bytes of all pictures.
    pub(super) fn size_bytes(&self) -> Result<u64> {
        let mut bytes = 0;
        for number in 0..self.count {
            bytes += std::fs::metadata(self.path.join(Self::name(number)))?.len();
        }
        Ok(bytes)
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let (begun, done) = (
            self.path.join(format!(".{name}.part")),
            self.path.join(name),
        );
        std::fs::write(&begun, bytes)
            .and_then(|()| std::fs::rename(&begun, &done))
            .with_context(|| format!("cannot write {}", done.display()))
    }
}
