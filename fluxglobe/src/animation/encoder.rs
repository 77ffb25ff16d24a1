//! An animation as a film: PNG files piped into ffmpeg.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context as _, Result, anyhow, bail};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::process::{Child, ChildStdin, Command};
use tokio::task::JoinHandle;

use super::shots::Shots;

/// Most bytes of what the encoder says that are kept.
const MOST_SAID_BYTES: u64 = 64 << 10;

/// Kinds of films.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Container {
    Mp4,
    Webm,
    Webp,
    Gif,
}

impl Container {
    /// The kind that a file's name ends with.
    pub(super) fn named(extension: &str) -> Option<Self> {
        match extension {
            "mp4" => Some(Self::Mp4),
            "webm" => Some(Self::Webm),
            "webp" => Some(Self::Webp),
            "gif" => Some(Self::Gif),
            _ => None,
        }
    }

    /// The encoder that these words name.
    fn encoder(self) -> &'static str {
        match self {
            Self::Mp4 => "libx264",
            Self::Webm => "libvpx-vp9",
            Self::Webp => "libwebp_anim",
            Self::Gif => "gif",
        }
    }

    /// Of this process's fixed words only: nothing of them comes from a file or a request.
    fn words(self) -> &'static [&'static str] {
        match self {
            // H.264 knows no alpha, and ffmpeg would drop it and leave the colours, so that soft edges get hard and
            // bright: pictures are laid over black. It halves its colours: sides are made even, with a black line.
            Self::Mp4 => &[
                "-vf",
                "format=gbrap,premultiply=inplace=1,pad=ceil(iw/2)*2:ceil(ih/2)*2",
                "-c:v",
                "libx264",
                "-preset",
                "medium",
                "-crf",
                "18",
                "-pix_fmt",
                "yuv420p",
                "-movflags",
                "+faststart",
                "-f",
                "mp4",
            ],
            Self::Webm => &[
                "-c:v",
                "libvpx-vp9",
                "-crf",
                "24",
                "-b:v",
                "0",
                "-pix_fmt",
                "yuva420p",
                "-f",
                "webm",
            ],
            Self::Webp => &[
                "-c:v",
                "libwebp_anim",
                "-quality",
                "90",
                "-loop",
                "0",
                "-f",
                "webp",
            ],
            Self::Gif => &[
                "-filter_complex",
                "split[a][b];[a]palettegen[p];[b][p]paletteuse",
                "-loop",
                "0",
                "-f",
                "gif",
            ],
        }
    }
}

/// ffmpeg at work.
pub(super) struct Encoder {
    child: Child,
    pictures: ChildStdin,
    said: JoinHandle<String>,
    begun: PathBuf,
    done: PathBuf,
}

/// Is ffmpeg there, and can it write this kind of film? Asked before anything is drawn for it.
pub(super) fn check(program: &Path, container: Container) -> Result<()> {
    let mut asked = std::process::Command::new(program);
    asked.args(["-hide_banner", "-loglevel", "error", "-encoders"]);
    let answer = asked
        .stdin(Stdio::null())
        .output()
        .map_err(|error| not_started(program, error))?;
    let listed = String::from_utf8_lossy(&answer.stdout);
    let wanted = container.encoder();
    if !listed.split_whitespace().any(|word| word == wanted) {
        bail!(
            "{} has no encoder {wanted}: install another build of ffmpeg (Debian's has it) or name it with --ffmpeg; \
             {WITHOUT_IT}",
            program.display()
        );
    }
    Ok(())
}

/// What can be had all the same.
const WITHOUT_IT: &str =
    "without it, -o FILE.png makes an animated PNG and -o FOLDER single pictures";

/// Why a program could not be started, and what to do.
fn not_started(program: &Path, error: std::io::Error) -> anyhow::Error {
    if error.kind() == std::io::ErrorKind::NotFound {
        return anyhow!(
            "{} is not there: install ffmpeg (Debian: apt-get install ffmpeg) or name it with --ffmpeg; {WITHOUT_IT}",
            program.display()
        );
    }
    anyhow::Error::new(error).context(format!("cannot start {}", program.display()))
}

impl Encoder {
    pub(super) fn start(
        program: &Path,
        container: Container,
        output: &Path,
        shots: &Shots,
    ) -> Result<Self> {
        let begun = begun(output)?;
        let fps = shots.fps.to_string();
        // What it says is read to its end and shown only if it fails.
        let mut command = Command::new(program);
        command
            .args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y"])
            .args(["-f", "image2pipe", "-framerate", &fps, "-c:v", "png"])
            .args(["-i", "pipe:0", "-an"])
            .args(container.words())
            .args(["-bitexact", "-map_metadata", "-1"])
            .arg(file_address(&begun))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .kill_on_drop(true);
        let spawned = command.spawn();
        let mut child = spawned.map_err(|error| not_started(program, error))?;
        let pictures = child.stdin.take().context("the encoder has an input")?;
        let mut talk = child.stderr.take().context("the encoder has a voice")?;
        let said = tokio::spawn(async move {
            let mut text = vec![];
            let mut kept = (&mut talk).take(MOST_SAID_BYTES);
            // Talk is worth keeping as far as it can be read.
            if kept.read_to_end(&mut text).await.is_ok() {
                drop(tokio::io::copy(&mut talk, &mut tokio::io::sink()).await);
            }
            String::from_utf8_lossy(&text).trim().to_owned()
        });
        Ok(Self {
            child,
            pictures,
            said,
            begun,
            done: output.to_owned(),
        })
    }

    pub(super) async fn add(&mut self, png: &[u8]) -> Result<()> {
        if let Err(error) = self.pictures.write_all(png).await {
            // It has ended early: what it said tells why.
            let said = (&mut self.said).await.unwrap_or_default();
            bail!("the encoder stopped: {error}; it said: {said}");
        }
        Ok(())
    }

    pub(super) async fn finish(mut self) -> Result<u64> {
        self.pictures.shutdown().await?;
        drop(self.pictures);
        let status = self.child.wait().await?;
        if !status.success() {
            let said = self.said.await.unwrap_or_default();
            remove(&self.begun);
            bail!("the encoder failed ({status}): {said}");
        }
        std::fs::rename(&self.begun, &self.done)
            .with_context(|| format!("cannot write {}", self.done.display()))?;
        Ok(std::fs::metadata(&self.done)?.len())
    }

    pub(super) async fn abandon(mut self) {
        if let Err(error) = self.child.kill().await {
            tracing::warn!(%error, "the encoder could not be stopped");
        }
        remove(&self.begun);
    }
}

/// A path as an address of ffmpeg, whatever characters are in it.
fn file_address(path: &Path) -> OsString {
    let mut address = OsString::from("file:");
    address.push(path);
    address
}

/// Where an output is written before it is done: beside it, so that it can be renamed.
pub(super) fn begun(output: &Path) -> Result<PathBuf> {
    let name = output
        .file_name()
        .with_context(|| format!("{} names no file", output.display()))?;
    let mut part = OsString::from(".");
    part.push(name);
    part.push(".part");
    Ok(output.with_file_name(part))
}

/// Removes what was begun.
pub(super) fn remove(begun: &Path) {
    if let Err(error) = std::fs::remove_file(begun)
        && error.kind() != std::io::ErrorKind::NotFound
    {
        tracing::warn!(path = %begun.display(), %error, "a half-written file stays");
    }
}
