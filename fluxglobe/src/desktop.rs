//! Keeps Mesa's device chooser from looking for a desktop on machines that have none.
//!
//! The chooser is a layer of the Vulkan loader. It asks a Wayland session which device it uses, complains on standard
//! error where there is no session, and knows one switch only: a variable that must be there before the process starts.

use std::ffi::OsStr;
use std::os::unix::process::CommandExt as _;

/// Mesa's switch: 1 turns the chooser off.
const SWITCH: &str = "NODEVICE_SELECT";
/// Either one means that there is a desktop, on which the chooser knows better than we do.
const DESKTOP: [&str; 2] = ["WAYLAND_DISPLAY", "DISPLAY"];

/// Becomes the same program with the switch set, once, where there is no desktop and nobody has set it. Goes on as it
/// is where that fails: then there is a line of noise and no harm.
pub(crate) fn leave_alone() {
    if !is_wanted(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty())) {
        return;
    }
    if let Ok(program) = std::env::current_exe() {
        let mut words = std::env::args_os();
        let mut again = std::process::Command::new(program);
        again.arg0(
            words
                .next()
                .unwrap_or_else(|| OsStr::new("fluxglobe").to_owned()),
        );
        // Comes back only if it failed.
        drop(again.args(words).env(SWITCH, "1").exec());
    }
}

fn is_wanted(is_set: impl Fn(&str) -> bool) -> bool {
    !is_set(SWITCH) && !DESKTOP.into_iter().any(is_set)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_desktop_and_a_choice_that_was_made_are_left_as_they_are() {
        let with = |names: &'static [&str]| is_wanted(|name| names.contains(&name));
        assert!(with(&[]));
        assert!(
            !with(&["NODEVICE_SELECT"]),
            "it would start itself for ever"
        );
        assert!(!with(&["DISPLAY"]));
        assert!(!with(&["WAYLAND_DISPLAY"]));
    }
}
