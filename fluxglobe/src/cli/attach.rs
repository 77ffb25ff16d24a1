//! Words of `fluxglobe attach`.

use clap::Args;
use contract::index::DimensionIndex;
use contract::product::ProductId;

/// `fluxglobe attach`.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Each step is read once: its variable, unit, sign, grid and time are found as those of a file are (CF conventions, or a profile), and what
cannot be read rightly is refused. What is stored of it is the digest of its values and where they lie, a few hundred bytes. Whoever reads
the product then, a tile, a budget, a series, SQL or an export, has the values from there, and compares them with the digest: values that
changed there since are an error and never a number. Nothing is written to the store that is attached.

  Zarr 2, Zarr 3      a group: a folder, a part of a bucket (s3://, gs://, az://), or an address (http://, https://); in
                      file:///FOLDER signs are escaped as in other URLs (%20 is a space), in a folder's path they are not
  Icechunk            a repository, alike; what is read is the state that its branch main had when it was attached, whatever is
                      committed there later

Credentials for buckets come from the environment and are not stored: whoever reads the product needs them too, and in a cluster every
service needs the way to the store. For S3 they are
  AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and, if there is one, AWS_SESSION_TOKEN
  AWS_REGION (us-east-1)               the region of the bucket
  AWS_ENDPOINT_URL                     another server than Amazon's; AWS_ALLOW_HTTP=true where it begins with http://
Without any of the keys, or with AWS_SKIP_SIGNATURE=true, what is open to everybody is read. For gs:// and az:// the variables are GOOGLE_*
and AZURE_*, alike. A bucket need not let itself be listed: then its metadata are to be consolidated, or what the array names is read.
What is refused there (credentials that have ended, a bucket that is gone, a wrong region) is an error that says so with store, array and
chunk; it is not taken for a chunk that was never written.

What came since, or was revised, comes with --refresh, as the product's next version. A product that was landed is not attached over, and one
that is attached to another store, array or index only with --replace.

Examples:
  fluxglobe attach /data/sst.zarr --variable analysed_sst --product sst-attached
  fluxglobe attach s3://BUCKET/flux.icechunk --variable fgco2
  AWS_REGION=us-west-2 fluxglobe attach s3://PUBLIC-BUCKET/sst.zarr --variable analysed_sst
  fluxglobe attach /data/ocean.zarr --variable thetao --index depth=0
  fluxglobe attach /new/place/sst.zarr --variable analysed_sst --product sst-attached --replace
  fluxglobe attach --refresh sst-attached")]
pub(crate) struct Attach {
    /// Where the store is: a folder, or `s3://BUCKET/PREFIX`, `gs://BUCKET/PREFIX`, `az://CONTAINER/PREFIX`, `https://HOST/PATH`.
    #[arg(value_name = "URL", required_unless_present = "refresh")]
    pub(crate) url: Option<String>,
    /// Array of the values.
    #[arg(long, value_name = "NAME", required_unless_present_any = ["refresh", "profile"])]
    pub(crate) variable: Option<String>,
    /// Name of a shipped profile or a profile file (TOML), where the CF conventions do not say enough: it names the array, and what
    /// its quantity, unit, sign, grid and time are.
    #[arg(long, value_name = "NAME|FILE", conflicts_with = "variable")]
    pub(crate) profile: Option<String>,
    /// Product to attach as, if not one of the array's or the profile's name.
    #[arg(long, value_name = "PRODUCT")]
    pub(crate) product: Option<ProductId>,
    /// Of a dimension beside time, latitude and longitude the index that is read, from 0 on: a depth, a height, a member. May
    /// be given several times.
    #[arg(long, value_name = "DIMENSION=INDEX")]
    pub(crate) index: Vec<DimensionIndex>,
    /// Where the product is attached to another store, array or index already, have this be its next version: a store that moved, say.
    /// Without it that is refused.
    #[arg(long)]
    pub(crate) replace: bool,
    /// Attach anew what this product is attached to: steps that came since or were revised become its next version.
    #[arg(long, value_name = "PRODUCT", conflicts_with_all = ["url", "variable", "profile", "product", "index", "replace"])]
    pub(crate) refresh: Option<ProductId>,
    /// JSON instead of text.
    #[arg(long)]
    pub(crate) json: bool,
}
