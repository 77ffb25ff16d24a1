//! What references and attachments begin with: neither a Parquet file nor a file of any format that lands begins so.

/// The first member of their JSON.
const MARK: &[u8] = b"{\"attached\":";

/// Is this a reference or an attachment, and neither a field nor a file?
pub fn is_attached(content: &[u8]) -> bool {
    content.starts_with(MARK)
}
