//! `fluxglobe render legend`: a product and a look in, a file that says what its colours mean out.

use anyhow::{Context as _, Result};
use storage::Store;
use tile_server::legend::{Form, Legend};

use crate::cli::{RenderLegend, Settings};
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, store: &Store, options: &RenderLegend) -> Result<()> {
    let path = options.output.display();
    let ending = options
        .output
        .extension()
        .and_then(|ending| ending.to_str());
    let form = ending.and_then(|ending| Form::named(&ending.to_ascii_lowercase()));
    let form = form.with_context(|| format!("{path}: a legend is a .png, .svg or .json file"))?;
    let manifest = deployment::manifest(store, &options.layer, &settings.data).await?;
    let transfer = options.look.options().over(manifest.quantity)?;
    let content = Legend::of(manifest.quantity, &transfer).encoded(form)?;
    std::fs::write(&options.output, content).with_context(|| format!("cannot write {path}"))?;
    progress::result(&path.to_string())
}
