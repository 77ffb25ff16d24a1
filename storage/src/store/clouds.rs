//! Buckets of clouds: opened with each cloud's usual variables, refused with advice when one is missing.

use std::sync::Arc;

use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey};
use object_store::azure::{AzureConfigKey, MicrosoftAzureBuilder};
use object_store::gcp::{GoogleCloudStorageBuilder, GoogleConfigKey};
use object_store::{BackoffConfig, ClientConfigKey, ObjectStore, RetryConfig};

use super::answers::Connector;
use super::location::Cloud;
use super::settings::{RetryLimits, Settings};

/// Opens a bucket; nothing is sent yet.
///
/// # Errors
/// What to set, in words that hold no value of a variable.
pub(super) fn open(
    cloud: Cloud,
    bucket: &str,
    settings: &Settings,
) -> Result<Arc<dyn ObjectStore>, String> {
    match cloud {
        Cloud::S3 => s3(bucket, settings),
        Cloud::Google => google(bucket, settings),
        Cloud::Azure => azure(bucket, settings),
    }
}

fn s3(bucket: &str, settings: &Settings) -> Result<Arc<dyn ObjectStore>, String> {
    use AmazonS3ConfigKey as Key;
    let mut builder = AmazonS3Builder::new();
    for (key, value) in settings.options::<Key>("AWS_") {
        builder = builder.with_config(key, value);
    }
    let is_set = |key| builder.get_config_value(&key).is_some();
    let has_keys = is_set(Key::AccessKeyId) && is_set(Key::SecretAccessKey);
    let has_identity = is_set(Key::WebIdentityTokenFile) && is_set(Key::RoleArn);
    let has_container = is_set(Key::ContainerCredentialsRelativeUri)
        || is_set(Key::ContainerCredentialsFullUri) && is_set(Key::ContainerAuthorizationTokenFile);
    let has_some = [
        Key::AccessKeyId,
        Key::SecretAccessKey,
        Key::Token,
        Key::WebIdentityTokenFile,
        Key::RoleArn,
        Key::ContainerCredentialsRelativeUri,
        Key::ContainerCredentialsFullUri,
        Key::MetadataEndpoint,
    ]
    .into_iter()
    .any(is_set);
    let is_unsigned = settings.is_on("AWS_SKIP_SIGNATURE") || settings.may_be_unsigned && !has_some;
    // Without any of these the library would ask an instance's metadata service, an address that must be meant.
    if !(has_keys || has_identity || has_container || is_unsigned || is_set(Key::MetadataEndpoint))
    {
        return Err(
            "no credentials: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or \
             AWS_WEB_IDENTITY_TOKEN_FILE and AWS_ROLE_ARN; for the role of the machine itself set \
             AWS_METADATA_ENDPOINT=http://169.254.169.254"
                .to_owned(),
        );
    }
    let endpoint = [Key::S3Endpoint, Key::Endpoint]
        .iter()
        .find_map(|key| builder.get_config_value(key));
    let plain = plain_http(
        endpoint.as_deref(),
        settings,
        "AWS_ENDPOINT_URL",
        "AWS_ALLOW_HTTP",
    )?;
    for (key, value) in client_options(settings.retry_limits, plain) {
        builder = builder.with_config(Key::Client(key), value);
    }
    let store = builder
        .with_bucket_name(bucket)
        // Objects are created once: a store that cannot promise that is found out by `check_writable`.
        .with_config(Key::ConditionalPut, "etag")
        .with_skip_signature(is_unsigned)
        .with_http_connector(connector(settings))
        .with_retry(retries(settings.retry_limits))
        .build();
    Ok(Arc::new(store.map_err(|e| e.to_string())?))
}

fn google(bucket: &str, settings: &Settings) -> Result<Arc<dyn ObjectStore>, String> {
    use GoogleConfigKey as Key;
    let mut builder = GoogleCloudStorageBuilder::new();
    for (key, value) in settings.options::<Key>("GOOGLE_") {
        builder = builder.with_config(key, value);
    }
    let is_set = |key| builder.get_config_value(&key).is_some();
    let has_account = is_set(Key::ServiceAccount)
        || is_set(Key::ServiceAccountKey)
        || is_set(Key::ApplicationCredentials);
    let has_machine = settings.has_any(&["GCE_METADATA_HOST"]);
    let is_unsigned = settings.is_on("GOOGLE_SKIP_SIGNATURE")
        || settings.may_be_unsigned && !has_account && !has_machine;
    if !(has_account || is_unsigned || has_machine) {
        return Err(
            "no credentials: set GOOGLE_APPLICATION_CREDENTIALS to the file of a service \
             account; for the account of the machine itself set \
             GCE_METADATA_HOST=metadata.google.internal"
                .to_owned(),
        );
    }
    let endpoint = builder.get_config_value(&Key::BaseUrl);
    let plain = plain_http(
        endpoint.as_deref(),
        settings,
        "GOOGLE_BASE_URL",
        "GOOGLE_ALLOW_HTTP",
    )?;
    for (key, value) in client_options(settings.retry_limits, plain) {
        builder = builder.with_config(Key::Client(key), value);
    }
    let store = builder
        .with_bucket_name(bucket)
        .with_skip_signature(is_unsigned)
        .with_http_connector(connector(settings))
        .with_retry(retries(settings.retry_limits))
        .build();
    Ok(Arc::new(store.map_err(|e| e.to_string())?))
}

fn azure(container: &str, settings: &Settings) -> Result<Arc<dyn ObjectStore>, String> {
    use AzureConfigKey as Key;
    let mut builder = MicrosoftAzureBuilder::new();
    for prefix in ["AZURE_", "IDENTITY_ENDPOINT"] {
        for (key, value) in settings.options::<Key>(prefix) {
            builder = builder.with_config(key, value);
        }
    }
    let is_set = |key| builder.get_config_value(&key).is_some();
    let is_emulator = settings.is_on("AZURE_STORAGE_USE_EMULATOR");
    if !is_emulator && !is_set(Key::AccountName) {
        return Err("no account: set AZURE_STORAGE_ACCOUNT_NAME".to_owned());
    }
    let has_key = is_set(Key::AccessKey) || is_set(Key::SasKey) || is_set(Key::Token);
    let has_client = is_set(Key::ClientId)
        && is_set(Key::AuthorityId)
        && (is_set(Key::ClientSecret) || is_set(Key::FederatedTokenFile));
    let has_some = has_key
        || [Key::ClientId, Key::ClientSecret, Key::MsiEndpoint]
            .into_iter()
            .any(is_set);
    let is_unsigned =
        settings.is_on("AZURE_SKIP_SIGNATURE") || settings.may_be_unsigned && !has_some;
    if !(is_emulator || has_key || has_client || is_unsigned || is_set(Key::MsiEndpoint)) {
        return Err("no credentials: set AZURE_STORAGE_ACCOUNT_KEY or AZURE_STORAGE_SAS_KEY, or \
             AZURE_CLIENT_ID, AZURE_TENANT_ID and AZURE_CLIENT_SECRET; for the identity of the machine \
             itself set AZURE_MSI_ENDPOINT"
            .to_owned());
    }
    let endpoint = builder.get_config_value(&Key::Endpoint);
    let plain = plain_http(
        endpoint.as_deref(),
        settings,
        "AZURE_STORAGE_ENDPOINT",
        "AZURE_ALLOW_HTTP",
    )?;
    for (key, value) in client_options(settings.retry_limits, plain) {
        builder = builder.with_config(Key::Client(key), value);
    }
    let store = builder
        .with_container_name(container)
        .with_skip_signature(is_unsigned && !is_emulator)
        .with_http_connector(connector(settings))
        .with_retry(retries(settings.retry_limits))
        .build();
    Ok(Arc::new(store.map_err(|e| e.to_string())?))
}

/// May requests go out without encryption? Only to an endpoint that says `http://`, and only if that is allowed.
fn plain_http(
    endpoint: Option<&str>,
    settings: &Settings,
    endpoint_name: &str,
    allowed_name: &str,
) -> Result<bool, String> {
    let is_plain = match endpoint.map(url::Url::parse) {
        None => false,
        Some(Err(e)) => return Err(format!("{endpoint_name} is no URL: {e}")),
        Some(Ok(url)) => match url.scheme() {
            "https" => false,
            "http" => true,
            _ => {
                return Err(format!(
                    "{endpoint_name} must begin with https:// or http://"
                ));
            }
        },
    };
    if is_plain && !settings.is_on(allowed_name) {
        return Err(format!(
            "{endpoint_name} is not encrypted: write https://, or set {allowed_name}=true"
        ));
    }
    Ok(is_plain)
}

/// Time limits and encryption, as every cloud's builder takes them.
fn client_options(retry_limits: RetryLimits, is_plain: bool) -> [(ClientConfigKey, String); 3] {
    let seconds = |limit: std::time::Duration| format!("{} ms", limit.as_millis());
    [
        (ClientConfigKey::AllowHttp, is_plain.to_string()),
        (
            ClientConfigKey::ConnectTimeout,
            seconds(retry_limits.connect),
        ),
        (ClientConfigKey::Timeout, seconds(retry_limits.request)),
    ]
}

fn connector(settings: &Settings) -> Connector {
    Connector {
        retries: settings.retry_limits.retries,
    }
}

fn retries(retry_limits: RetryLimits) -> RetryConfig {
    let backoff = retry_limits.backoff();
    RetryConfig {
        backoff: BackoffConfig {
            init_backoff: backoff.first_pause,
            max_backoff: backoff.longest_pause,
            base: 2.0,
        },
        // Time is the limit: pauses only grow, so that this many are never reached.
        max_retries: 10_000,
        retry_timeout: retry_limits.retries,
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead as _, BufReader, Write as _};
    use std::net::TcpListener;
    use std::time::Duration;

    use object_store::ObjectStoreExt as _;
    use object_store::path::Path;

    use super::*;
    use crate::store::warnings::Warnings;

    const SECRET: &str = "c2VjcmV0LXZhbHVl";

    fn settings(variables: &[(&str, &str)]) -> Settings {
        let owned = |&(name, value): &(&str, &str)| (name.to_owned(), value.to_owned());
        Settings::from_variables(variables.iter().map(owned))
    }

    fn refusal(cloud: Cloud, variables: &[(&str, &str)]) -> String {
        let reason = open(cloud, "bucket", &settings(variables)).unwrap_err();
        assert!(!reason.contains(SECRET), "{reason}");
        reason
    }

    #[test]
    fn a_missing_secret_is_named_for_every_cloud() {
        let half = [("AWS_ACCESS_KEY_ID", "me")];
        assert!(refusal(Cloud::S3, &half).contains("AWS_SECRET_ACCESS_KEY"));
        assert!(refusal(Cloud::S3, &[]).contains("AWS_ACCESS_KEY_ID"));
        assert!(refusal(Cloud::Google, &[]).contains("GOOGLE_APPLICATION_CREDENTIALS"));
        assert!(refusal(Cloud::Azure, &[]).contains("AZURE_STORAGE_ACCOUNT_NAME"));
        let account = [("AZURE_STORAGE_ACCOUNT_NAME", "me")];
        assert!(refusal(Cloud::Azure, &account).contains("AZURE_STORAGE_ACCOUNT_KEY"));
    }

    #[test]
    fn what_is_open_to_everybody_is_read_without_credentials_but_not_with_half_of_them() {
        let account = [("AZURE_STORAGE_ACCOUNT_NAME", "me")];
        for (cloud, variables) in [
            (Cloud::S3, &[][..]),
            (Cloud::Google, &[]),
            (Cloud::Azure, &account),
        ] {
            open(cloud, "bucket", &settings(variables).as_anybody()).unwrap();
            refusal(cloud, variables);
        }
        let half = settings(&[("AWS_ACCESS_KEY_ID", "me")]).as_anybody();
        let reason = open(Cloud::S3, "bucket", &half).unwrap_err();
        assert!(reason.contains("AWS_SECRET_ACCESS_KEY"), "{reason}");
    }

    /// The head of the request for an object, as the endpoint of a store on this machine gets it; none if it gets none.
    async fn requested(
        with: impl FnOnce(Settings) -> Settings,
        more: &[(&str, &str)],
    ) -> Option<String> {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("http://{}", listener.local_addr().unwrap());
        let own = [
            ("AWS_ENDPOINT_URL", endpoint.as_str()),
            ("AWS_ALLOW_HTTP", "true"),
        ];
        let store = open(
            Cloud::S3,
            "bucket",
            &with(settings(&[&own[..], more].concat())),
        )
        .unwrap();
        let (send, heads) = std::sync::mpsc::sync_channel(1);
        let answering = std::thread::Builder::new().spawn(move || {
            let (mut stream, _from) = listener.accept().unwrap();
            let lines = BufReader::new(stream.try_clone().unwrap()).lines();
            let lines = lines
                .map_while(Result::ok)
                .take_while(|line| !line.is_empty());
            send.send(lines.collect::<Vec<_>>().join("\n")).unwrap();
            let absent = "HTTP/1.1 404 Not Found\r\ncontent-length: 0\r\nconnection: close\r\n\r\n";
            stream.write_all(absent.as_bytes()).unwrap();
        });
        drop(answering.unwrap());
        let asked =
            tokio::time::timeout(Duration::from_secs(20), store.get(&Path::from("key"))).await;
        drop(asked);
        heads
            .try_recv()
            .ok()
            .map(|head: String| head.to_lowercase())
    }

    #[tokio::test]
    async fn a_store_that_does_not_answer_is_told_of_once_and_at_once() {
        let (warned, _guard) = Warnings::kept();
        // Nobody listens there any more.
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("http://{}", listener.local_addr().unwrap());
        drop(listener);
        let variables = [
            ("AWS_ENDPOINT_URL", endpoint.as_str()),
            ("AWS_ALLOW_HTTP", "true"),
        ];
        let mut settings = settings(&variables).as_anybody();
        settings.retry_limits.retries = Duration::from_millis(600);
        let store = open(Cloud::S3, "bucket", &settings).unwrap();
        assert!(store.get(&Path::from("key")).await.is_err());
        let lines = warned.lines();
        let [line] = &lines[..] else {
            panic!("{lines:?}");
        };
        for part in ["127.0.0.1 does not answer", "at most 0.6 s"] {
            assert!(line.contains(part), "{line}");
        }
    }

    #[tokio::test]
    async fn requests_are_signed_with_what_there_is_and_not_at_all_where_nothing_is() {
        let keys = [
            ("AWS_ACCESS_KEY_ID", "me"),
            ("AWS_SECRET_ACCESS_KEY", SECRET),
        ];
        let signed = requested(|settings| settings, &keys).await.unwrap();
        assert!(signed.starts_with("get /bucket/key "), "{signed}");
        assert!(signed.contains("authorization: aws4-hmac"), "{signed}");
        let signed = requested(Settings::as_anybody, &keys).await.unwrap();
        assert!(
            signed.contains("authorization:"),
            "they are there: {signed}"
        );
        let told = [&keys[..], &[("AWS_SKIP_SIGNATURE", "true")]].concat();
        for (more, what) in [(&[][..], "nothing is there"), (&told, "it is switched off")] {
            let head = requested(Settings::as_anybody, more).await.expect(what);
            assert!(head.starts_with("get /bucket/key "), "{head}");
            assert!(!head.contains("authorization"), "{what}: {head}");
        }
    }

    #[test]
    fn a_secret_that_cannot_be_read_is_not_repeated() {
        let key = [
            ("AZURE_STORAGE_ACCOUNT_NAME", "me"),
            ("AZURE_STORAGE_ACCOUNT_KEY", "c2VjcmV0LXZhbHVl!"),
        ];
        refusal(Cloud::Azure, &key);
        let json = [("GOOGLE_SERVICE_ACCOUNT_KEY", SECRET)];
        refusal(Cloud::Google, &json);
        let file = [("GOOGLE_SERVICE_ACCOUNT", "no/such/file")];
        assert!(refusal(Cloud::Google, &file).contains("no/such/file"));
    }

    #[test]
    fn a_plain_endpoint_is_used_only_if_it_is_meant() {
        let keys = [
            ("AWS_ACCESS_KEY_ID", "me"),
            ("AWS_SECRET_ACCESS_KEY", SECRET),
        ];
        let with = |more: &[(&str, &str)]| settings(&[&keys[..], more].concat());
        let endpoint = ("AWS_ENDPOINT_URL", "http://127.0.0.1:1");
        let reason = open(Cloud::S3, "b", &with(&[endpoint])).unwrap_err();
        assert!(reason.contains("AWS_ALLOW_HTTP"), "{reason}");
        open(
            Cloud::S3,
            "b",
            &with(&[endpoint, ("AWS_ALLOW_HTTP", "true")]),
        )
        .unwrap();
        let odd = with(&[("AWS_ENDPOINT_URL_S3", "ftp://h")]);
        assert!(open(Cloud::S3, "b", &odd).unwrap_err().contains("https://"));
        // Allowing it changes nothing for an encrypted endpoint.
        let encrypted = with(&[
            ("AWS_ENDPOINT_URL", "https://h"),
            ("AWS_ALLOW_HTTP", "true"),
        ]);
        assert_eq!(
            plain_http(Some("https://h"), &encrypted, "E", "AWS_ALLOW_HTTP"),
            Ok(false)
        );
    }

    #[test]
    fn whole_settings_open_each_cloud() {
        let s3 = [
            ("AWS_ACCESS_KEY_ID", "me"),
            ("AWS_SECRET_ACCESS_KEY", SECRET),
        ];
        open(Cloud::S3, "bucket", &settings(&s3)).unwrap();
        let machine = [("GCE_METADATA_HOST", "metadata.google.internal")];
        open(Cloud::Google, "bucket", &settings(&machine)).unwrap();
        let azure = [
            ("AZURE_STORAGE_ACCOUNT_NAME", "me"),
            ("AZURE_STORAGE_ACCOUNT_KEY", SECRET),
        ];
        open(Cloud::Azure, "bucket", &settings(&azure)).unwrap();
        let emulator = [("AZURE_STORAGE_USE_EMULATOR", "true")];
        open(Cloud::Azure, "bucket", &settings(&emulator)).unwrap();
    }
}
