//! Words for what becomes of products that are made of one that is derived anew.

use clap::Args;

/// Is it brought along?
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Follow {
    /// Bring what is made of it up to date too, directly or through others, each as it was asked for, and print the version of each; carbon of
    /// a flux is added up where it never was. If absent, what is of an older version is named and stays.
    #[arg(long)]
    pub(crate) follow: bool,
}
