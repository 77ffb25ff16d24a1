//! Notices that would make the ingest service read what is none of their sender's business.

use std::os::unix::fs::symlink;

use harness::web::Web;

use super::{Bad, Ground, bad, notice};

fn location(path: &str, says: &'static str) -> Bad {
    bad(notice(path).to_json(), "location", says)
}

#[test]
fn addresses_of_the_inner_network_are_refused_and_never_asked() {
    let ground = Ground::new();
    let inner = Web::empty().unwrap();
    let port = inner.address.port();
    let bad = [
        format!("http://127.0.0.1:{port}/secret.nc"),
        format!("http://localhost:{port}/secret.nc"),
        format!("http://2130706433:{port}/secret.nc"),
        format!("http://[::ffff:127.0.0.1]:{port}/secret.nc"),
        "http://169.254.169.254/latest/meta-data".to_owned(),
        "https://10.0.0.1/secret.nc".to_owned(),
    ]
    .map(|path| location(&path, "--allow-host"));
    ground.refuse(&[], &bad);
    assert_eq!(inner.came(), 0, "an inner address was asked");
}

#[test]
fn a_redirect_to_the_inner_network_is_refused_and_not_followed() {
    let ground = Ground::new();
    let inner = Web::empty().unwrap();
    let to_inner = Web::redirecting(&format!("http://{}/secret.nc", inner.address)).unwrap();
    let to_metadata = Web::redirecting("http://169.254.169.254/latest/meta-data").unwrap();
    let to_file = Web::redirecting("file:///etc/passwd").unwrap();
    let address = |web: &Web| format!("http://{}/granule.nc", web.address);
    let bad = [
        location(&address(&to_inner), "--allow-host"),
        location(&address(&to_metadata), "169.254.169.254"),
        location(&address(&to_file), "scheme"),
    ];
    // The hosts that redirect are allowed: what they lead to is not.
    let allowed = [&to_inner, &to_metadata, &to_file].map(|web| web.address.to_string());
    ground.refuse(&[("FLUXGLOBE_ALLOW_HOST", &allowed.join(","))], &bad);
    assert!(
        to_inner.came() > 0 && to_metadata.came() > 0,
        "nobody was redirected"
    );
    assert_eq!(inner.came(), 0, "the redirect was followed");
}

#[test]
fn ways_out_of_the_allowed_folder_are_refused() {
    let ground = Ground::new();
    let secret = ground.path("secret.nc");
    std::fs::copy(ground.good(), &secret).unwrap();
    let inbox = ground.path("inbox");
    symlink(&secret, inbox.join("link.nc")).unwrap();
    symlink(ground.path(""), inbox.join("up")).unwrap();
    let inbox = inbox.display();
    let bad = [
        secret.display().to_string(),
        format!("{inbox}/../secret.nc"),
        format!("file://{inbox}/%2e%2e/secret.nc"),
        format!("{inbox}/link.nc"),
        format!("{inbox}/up/secret.nc"),
        "/proc/self/environ".to_owned(),
        "/etc/passwd".to_owned(),
    ]
    .map(|path| location(&path, "--allow-folder"));
    ground.refuse(&[], &bad);
}
