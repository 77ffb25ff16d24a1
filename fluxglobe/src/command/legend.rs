//! `fluxglobe render legend`: a product and a look in, a file that says what its colours mean out.

use std::path::Path;

use anyhow::{Context as _, Result};
use contract::colour::TransferOptions;
use contract::quantity::Quantity;
use legend::{Form, Legend};
use storage::Store;

use crate::cli::{RenderLegend, Settings};
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, store: &Store, options: &RenderLegend) -> Result<()> {
    let form = form_of(&options.output)?;
    let manifest = deployment::manifest(store, &options.layer, &settings.data).await?;
    let content = legend(manifest.quantity, &options.look.options(), form)?;
    let path = options.output.display();
    std::fs::write(&options.output, content).with_context(|| format!("cannot write {path}"))?;
    progress::result(&path.to_string())
}

/// What a file's name says that it is.
fn form_of(path: &Path) -> Result<Form> {
    let ending = path.extension().and_then(|ending| ending.to_str());
    let form = ending.and_then(|ending| Form::named(&ending.to_ascii_lowercase()));
    form.with_context(|| format!("{}: a legend is a .png, .svg or .json file", path.display()))
}

fn legend(quantity: Quantity, options: &TransferOptions, form: Form) -> Result<Vec<u8>> {
    let transfer = options.over(quantity)?;
    Ok(Legend::of(quantity, &transfer).encoded(form)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_of_a_file_says_what_is_written() {
        let begins = |name: &str| {
            let form = form_of(Path::new(name)).unwrap();
            let options = TransferOptions::default();
            legend(Quantity::CarbonFlux, &options, form).unwrap()
        };
        assert!(begins("a/legend.png").starts_with(b"\x89PNG"));
        assert!(begins("LEGEND.SVG").starts_with(b"<svg"));
        assert!(begins("legend.v2.json").starts_with(b"{\"low\":-40.0"));
        for name in ["legend", "legend.gif", "png", ".svg"] {
            let refused = form_of(Path::new(name)).unwrap_err().to_string();
            assert!(refused.contains(".png, .svg or .json"), "{refused}");
        }
    }

    #[test]
    fn looks_that_cannot_be_drawn_have_no_legend() {
        let options = TransferOptions {
            palette: "ice".parse().ok(),
            colours: "0:#000000,1:#ffffff".parse().unwrap(),
            ..TransferOptions::default()
        };
        assert!(legend(Quantity::WindSpeed, &options, Form::Json).is_err());
    }
}
