//! Which tests go without a graphics device: no adapter is a failure unless `NO_GPU=1` says that it is meant.

use std::path::Path;

use crate::{note, variable};

/// How lines of these begin in the file that `FLUXGLOBE_SKIPPED` names; `report.sh` counts them apart.
const SWITCHED_OFF: &str = "NO_GPU=1: ";

/// Does the caller go without a graphics device, by `NO_GPU=1`? That is said then, with `what` is not tested, on standard error and in
/// the file that `FLUXGLOBE_SKIPPED` names.
///
/// # Panics
/// If that file cannot be written.
pub fn is_without_gpu(what: &str) -> bool {
    let is_off = variable("NO_GPU").is_some_and(|value| value == Path::new("1"));
    if is_off {
        eprintln!("NOT RUN: {}", line(what));
        note(&line(what));
    }
    is_off
}

fn line(what: &str) -> String {
    format!("{SWITCHED_OFF}{what}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    #[test]
    fn what_goes_without_a_device_is_counted_apart_from_what_may_not_run() {
        let name = format!("fluxglobe-not-run-{}", std::process::id());
        let file = std::env::temp_dir().join(name);
        let [shaders, seams] = ["shaders", "seams"].map(line);
        let text = format!("{shaders}\n{seams}\n{shaders}\na::test\n");
        std::fs::write(&file, text).unwrap();
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/report.sh");
        let told = Command::new(script).arg(&file).output().unwrap();
        std::fs::remove_file(&file).unwrap();
        let said = String::from_utf8(told.stdout).unwrap();
        assert!(told.status.success(), "{said}");
        let listed = crate::LISTED_COUNT;
        for wanted in [
            &format!("1 of at most {listed} listed tests did not run"),
            "2 things were not tested for want of a graphics device",
            "    a::test\n",
            "    seams\n    shaders\n",
        ] {
            assert!(said.contains(wanted), "{wanted}: {said}");
        }
    }
}
