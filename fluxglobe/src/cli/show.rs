//! `--print-settings`: what a command would run with, as environment variables, and where each value comes from.

use std::fmt::Write as _;

use clap::parser::ValueSource;
use clap::{ArgMatches, Command};

/// Every setting of the chosen command, a line each: `FLUXGLOBE_DATA=fluxglobe-data  # default`.
///
/// Passwords have no settings of their own, only files that hold them; one inside an address is not shown.
pub(crate) fn settings(program: &Command, matches: &ArgMatches) -> String {
    let mut text = String::new();
    write_level(&mut text, program, matches);
    text
}

fn write_level(text: &mut String, command: &Command, matches: &ArgMatches) {
    let deeper = matches.subcommand();
    for argument in command.get_arguments() {
        // A global setting is shown where it was given: at the deepest level, which knows of it.
        if argument.get_id() == "print_settings" || (argument.is_global_set() && deeper.is_some()) {
            continue;
        }
        let id = argument.get_id().as_str();
        if let Ok(Some(values)) = matches.try_get_raw(id) {
            let values: Vec<String> = values
                .map(|v| without_password(&v.to_string_lossy()))
                .collect();
            write_line(text, argument, &values.join(","), matches.value_source(id));
        }
    }
    if let Some((name, matches)) = deeper
        && let Some(command) = command.find_subcommand(name)
    {
        write_level(text, command, matches);
    }
}

fn write_line(text: &mut String, argument: &clap::Arg, value: &str, source: Option<ValueSource>) {
    let environment = argument
        .get_env()
        .map(|name| name.to_string_lossy().into_owned());
    let flag = argument.get_long().map(|name| format!("--{name}"));
    let source = match source {
        Some(ValueSource::CommandLine) => flag.as_deref().unwrap_or("command line"),
        Some(ValueSource::EnvVariable) => "environment",
        _ => "default",
    };
    let name = environment
        .or_else(|| flag.clone())
        .unwrap_or_else(|| argument.get_id().to_string());
    // Writing to a string cannot fail.
    writeln!(text, "{name}={value}  # {source}").expect("a string takes any text");
}

/// An address without the password in it: `scheme://user:***@host`.
fn without_password(value: &str) -> String {
    let Some((scheme, rest)) = value.split_once("://") else {
        return value.to_owned();
    };
    let end = rest.find('/').unwrap_or(rest.len());
    match rest[..end].rsplit_once('@') {
        Some((user, host)) => {
            let user = user.split_once(':').map_or(user, |(name, _password)| name);
            format!("{scheme}://{user}:***@{host}{}", &rest[end..])
        }
        None => value.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Arg;

    fn program() -> Command {
        let data = Arg::new("data")
            .long("data")
            .env("FLUXGLOBE_TEST_DATA_SHOWN")
            .default_value("here")
            .global(true);
        let store = Arg::new("store").long("store");
        Command::new("program")
            .arg(data)
            .subcommand(Command::new("serve").arg(store))
    }

    #[test]
    fn each_setting_is_shown_once_with_where_it_comes_from() {
        let words = [
            "program",
            "serve",
            "--store",
            "s3://bucket",
            "--data",
            "there",
        ];
        let mut program = program();
        let matches = program.try_get_matches_from_mut(words).unwrap();
        program.build();
        let text = settings(&program, &matches);
        assert!(text.contains("--store=s3://bucket  # --store\n"), "{text}");
        assert_eq!(
            text.matches("FLUXGLOBE_TEST_DATA_SHOWN=there").count(),
            1,
            "{text}"
        );
    }

    #[test]
    fn a_password_in_an_address_is_not_shown() {
        assert_eq!(
            without_password("postgres://me:secret@host/db"),
            "postgres://me:***@host/db"
        );
        assert_eq!(without_password("s3://bucket/a@b"), "s3://bucket/a@b");
        assert_eq!(without_password("plain"), "plain");
    }
}
