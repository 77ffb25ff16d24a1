//! Compiled shaders that outlast the process, where the driver gives them out: a file for each kind of device.

use std::fs;
use std::path::{Path, PathBuf};

use contract::digest::Digest;

/// Larger files are of too many programs: they are begun anew.
const MOST_BYTES: usize = 64 << 20;
/// Bytes of the digest before the content, as text.
const DIGEST_BYTES: usize = 64;

/// The driver's cache of compiled shaders, and its file.
pub(super) struct Pipelines {
    cache: wgpu::PipelineCache,
    file: PathBuf,
    /// What the file holds.
    kept: Option<Digest>,
}

impl Pipelines {
    /// The cache of this kind of device in a folder; none if the device gives none out.
    pub(super) fn open(
        device: &wgpu::Device,
        adapter: &wgpu::AdapterInfo,
        folder: &Path,
    ) -> Option<Self> {
        if !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let file = folder.join(wgpu::util::pipeline_cache_key(adapter)?);
        let content = content_of(&file);
        let cache = created(device, content.as_deref());
        Some(Self {
            cache,
            kept: content.map(|content| Digest::of(&content)),
            file,
        })
    }

    /// What compilations take and give.
    pub(super) fn cache(&self) -> &wgpu::PipelineCache {
        &self.cache
    }

    /// Writes what has been compiled since, for the next process. A folder that cannot be written is no error: the
    /// next process compiles again.
    pub(super) fn keep(&self) {
        let Some(content) = self.cache.get_data() else {
            return;
        };
        let digest = Digest::of(&content);
        if self.kept == Some(digest) || content.len() > MOST_BYTES {
            return;
        }
        if let Err(error) = write(&self.file, digest, &content) {
            let file = self.file.display();
            tracing::debug!(%file, %error, "compiled shaders are not kept");
        }
    }
}

/// Folder of the files: the user's own.
pub(super) fn folder() -> Option<PathBuf> {
    Some(std::env::home_dir()?.join(".cache/fluxglobe/pipelines"))
}

/// The content of a file that is whole.
fn content_of(file: &Path) -> Option<Vec<u8>> {
    let bytes = fs::metadata(file).ok()?.len();
    if bytes > (MOST_BYTES + DIGEST_BYTES) as u64 {
        return None;
    }
    let mut digest = fs::read(file).ok()?;
    if digest.len() < DIGEST_BYTES {
        return None;
    }
    let content = digest.split_off(DIGEST_BYTES);
    let is_whole = Digest::of(&content).to_string().as_bytes() == digest;
    is_whole.then_some(content)
}

fn write(file: &Path, digest: Digest, content: &[u8]) -> std::io::Result<()> {
    let folder = file.parent().unwrap_or_else(|| Path::new("."));
    fs::create_dir_all(folder)?;
    let mut whole = digest.to_string().into_bytes();
    whole.extend_from_slice(content);
    // Renamed into place: processes that start at the same time read a whole file or none.
    let part = file.with_extension(std::process::id().to_string());
    fs::write(&part, whole)?;
    fs::rename(&part, file)
}

#[expect(
    unsafe_code,
    reason = "drivers may trust a cache's content: it carries a digest, and wgpu a header with driver and device"
)]
fn created(device: &wgpu::Device, content: Option<&[u8]>) -> wgpu::PipelineCache {
    // SAFETY: the content was given out by `get_data` and is whole; wgpu checks that device and driver are the same and
    // starts empty otherwise.
    unsafe {
        device.create_pipeline_cache(&wgpu::PipelineCacheDescriptor {
            label: Some("pipelines"),
            data: content,
            fallback: true,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_comes_back_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("deep/device");
        let content = b"compiled".to_vec();
        assert_eq!(content_of(&file), None);
        write(&file, Digest::of(&content), &content).unwrap();
        assert_eq!(content_of(&file), Some(content.clone()));
        let mut bytes = fs::read(&file).unwrap();
        bytes.truncate(bytes.len() - 1);
        fs::write(&file, &bytes).unwrap();
        assert_eq!(content_of(&file), None, "cut short");
        fs::write(&file, b"short").unwrap();
        assert_eq!(content_of(&file), None);
        let names = fs::read_dir(file.parent().unwrap()).unwrap();
        assert_eq!(names.count(), 1, "nothing is left beside it");
    }
}
