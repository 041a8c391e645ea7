//! Policies, trust and users, by what the server offers and by what it refuses.

use std::path::Path;

use opcua_bridge::BridgeConfig;
use opcua_bridge::config::{Mode, Policy};
use opcua_bridge::live::LiveBridge;
use serde_json::json;

use super::peer::{Machine, free_port, interpreter};
use super::{MAP, config, heard, is_condition, is_text, open, open_as};

/// Parameters of a secured connection with its certificates in a folder.
fn secured(port: u16, policy: Policy, pki: &Path) -> BridgeConfig {
    let mut secured = config(port);
    secured.security.mode = Mode::SignAndEncrypt;
    secured.security.policy = policy;
    secured.security.pki_folder = pki.display().to_string();
    secured
}

/// Waits until the server's certificate was refused, and trusts it.
fn trust(bridge: &mut LiveBridge, pki: &Path) {
    heard(bridge, |output| {
        is_condition(output, "connection", "is refused")
    });
    let rejected = std::fs::read_dir(pki.join("rejected")).unwrap();
    let rejected: Vec<_> = rejected.map(|entry| entry.unwrap()).collect();
    assert_eq!(rejected.len(), 1, "{rejected:?}");
    let trusted = pki.join("trusted").join(rejected[0].file_name());
    std::fs::rename(rejected[0].path(), trusted).unwrap();
}

#[test]
fn a_signed_and_encrypted_connection_needs_trust_and_then_carries_values() {
    let Some(python) = interpreter("opcua security") else {
        return;
    };
    let policies = [
        (Policy::Basic256Sha256, "Basic256Sha256", "Basic256Sha256"),
        (
            Policy::Aes128Sha256RsaOaep,
            "Aes128Sha256RsaOaep",
            "Aes128_Sha256_RsaOaep",
        ),
        (
            Policy::Aes256Sha256RsaPss,
            "Aes256Sha256RsaPss",
            "Aes256_Sha256_RsaPss",
        ),
    ];
    for (policy, offered, name) in policies {
        let (folder, pki) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let port = free_port();
        let more = json!({"secured": folder.path(), "policy": offered});
        let mut machine = Machine::start(&python, port, &["urn:abbe:machine"], &more);
        // Unsecured, it is refused with what there is.
        let mut bridge = open(&config(port), MAP);
        let offers = format!("the server offers {name} SignAndEncrypt");
        heard(&mut bridge, |output| {
            is_condition(output, "connection", &offers)
        });
        drop(bridge);
        let mut bridge = open(&secured(port, policy, pki.path()), MAP);
        trust(&mut bridge, pki.path());
        assert!(pki.path().join("own/cert.der").is_file());
        let said = heard(&mut bridge, |output| is_text(output, "20"));
        let is_secured = format!("{name} SignAndEncrypt");
        assert!(
            said.iter()
                .any(|one| is_condition(one, "connection", &is_secured)),
            "{said:?}"
        );
        machine.tell(&json!({"write": "T", "value": 24.5, "at_s": 1_480_411_729}));
        heard(&mut bridge, |output| is_text(output, "24.5"));
    }
}

#[test]
fn a_user_is_let_in_by_the_password_and_else_refused_with_the_remedy() {
    let Some(python) = interpreter("opcua user") else {
        return;
    };
    let (folder, pki) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let port = free_port();
    let more = json!({"secured": folder.path(), "user": ["abbe", "1887 µm"]});
    let _machine = Machine::start(&python, port, &["urn:abbe:machine"], &more);
    let mut config = secured(port, Policy::Basic256Sha256, pki.path());
    let mut bridge = open(&config, MAP);
    heard(&mut bridge, |output| {
        is_condition(output, "connection", "does not take anonymous users")
    });
    drop(bridge);
    config.security.user = "abbe".to_owned();
    config.security.password_file = "password.txt".to_owned();
    let mut bridge = open_as(&config, MAP, Some("another"));
    trust(&mut bridge, pki.path());
    let said = heard(&mut bridge, |output| {
        is_condition(output, "connection", "does not take this user or password")
    });
    assert!(!said.iter().any(|one| is_text(one, "20")), "{said:?}");
    drop(bridge);
    let mut bridge = open_as(&config, MAP, Some("1887 µm"));
    let said = heard(&mut bridge, |output| is_text(output, "20"));
    assert!(
        said.iter()
            .any(|one| is_condition(one, "connection", "user abbe")),
        "{said:?}"
    );
}
