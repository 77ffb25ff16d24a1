//! Settings of Kafka in the help of commands that only say in the event log what they made: the brokers, and where the rest is told.

use clap::Arg;

/// Heading of the settings of Kafka.
const HEADING: &str = "Kafka";

/// The same argument; one of Kafka's other than the brokers is taken as it was, and shown no more.
pub(super) fn brokers_alone(argument: Arg) -> Arg {
    if argument.get_help_heading() != Some(HEADING) {
        return argument;
    }
    if argument.get_id() != "kafka" {
        return argument.hide(true);
    }
    argument.help(
        "Kafka's brokers, HOST:PORT[,HOST:PORT...], at most 32, where they hold the event log; how they are spoken to is set as \
         `fluxglobe ingestd --help` says",
    )
}
