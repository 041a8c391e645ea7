//! The configuration of a session, as users of `rmw_zenoh_cpp` expect it.

use ::zenoh::Config;
use anyhow::{Context as _, anyhow};

use crate::environment::ZenohSettings;

/// What differs from Zenoh's own defaults. A peer, known to this computer only; the router of this
/// computer tells peers of each other and carries what goes to other hosts. Links that broke are given up and
/// tried again as in `launch_configs/three_hosts/zenoh_router.json5`.
const OWN: [(&str, &str); 10] = [
    ("mode", r#""peer""#),
    ("connect/endpoints", r#"["tcp/localhost:7447"]"#),
    ("connect/exit_on_failure", "false"),
    (
        "connect/retry",
        "{period_init_ms: 250, period_max_ms: 250, period_increase_factor: 1}",
    ),
    ("listen/endpoints", r#"["tcp/localhost:0"]"#),
    ("scouting/multicast/enabled", "false"),
    ("scouting/gossip/enabled", "true"),
    // Zenoh's clocks take a stamp that is 0.5 s ahead of their own for an error, of every sample. Nothing here needs
    // stamps: what was said is numbered, and times are in attachments.
    ("timestamping/enabled", "false"),
    // An attempt that a dead link swallows is given up, ms: TCP itself would ask more and more seldom.
    ("transport/unicast/open_timeout", "1000"),
    // A link that is silent for so long is given up, ms.
    ("transport/link/tx/lease", "4000"),
];

fn set(config: &mut Config, key: &str, value: &str) -> anyhow::Result<()> {
    let outcome = config.insert_json5(key, value);
    outcome.map_err(|error| anyhow!("`{key}={value}`: {error}"))
}

/// The configuration that the environment asks for.
///
/// # Errors
/// When the file cannot be read or an entry is no `key=value` that Zenoh knows.
pub(super) fn config(settings: &ZenohSettings) -> anyhow::Result<Config> {
    let mut config = match &settings.config_uri {
        Some(file) => Config::from_file(file)
            .map_err(|error| anyhow!("ZENOH_SESSION_CONFIG_URI={file}: {error}"))?,
        None => own().context("configuration of Zenoh")?,
    };
    let overrides = settings.config_override.as_deref().unwrap_or_default();
    for entry in overrides
        .split(';')
        .map(str::trim)
        .filter(|entry| !entry.is_empty())
    {
        let (key, value) = entry
            .split_once('=')
            .ok_or_else(|| anyhow!("ZENOH_CONFIG_OVERRIDE: `{entry}`: must be key=value"))?;
        set(&mut config, key.trim(), value.trim()).context("ZENOH_CONFIG_OVERRIDE")?;
    }
    Ok(config)
}

fn own() -> anyhow::Result<Config> {
    let mut config = Config::default();
    for (key, value) in OWN {
        set(&mut config, key, value)?;
    }
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn overridden(entries: &str) -> anyhow::Result<Config> {
        config(&ZenohSettings {
            config_override: Some(entries.to_owned()),
            ..ZenohSettings::default()
        })
    }

    #[test]
    fn a_session_is_a_peer_of_this_computer_unless_told_otherwise() {
        let plain = config(&ZenohSettings::default()).unwrap();
        let found = |config: &Config, key: &str| config.get_json(key).unwrap();
        assert_eq!(found(&plain, "mode"), r#""peer""#);
        assert_eq!(found(&plain, "scouting/multicast/enabled"), "false");
        assert_eq!(found(&plain, "timestamping/enabled"), "false");
        let entries = r#"mode="client"; connect/endpoints=["tcp/10.0.0.1:7447"];"#;
        let changed = overridden(entries).unwrap();
        assert_eq!(found(&changed, "mode"), r#""client""#);
        assert!(found(&changed, "connect/endpoints").contains("10.0.0.1"));
    }

    #[test]
    fn bad_settings_are_refused_by_name() {
        for bad in ["mode", "mode=\"boss\"", "no/such/key=1"] {
            let error = format!("{:#}", overridden(bad).unwrap_err());
            assert!(error.contains("ZENOH_CONFIG_OVERRIDE"), "{error}");
            assert!(error.contains(bad), "{error}");
        }
        let nowhere = ZenohSettings {
            config_uri: Some("/nowhere.json5".to_owned()),
            ..ZenohSettings::default()
        };
        let error = config(&nowhere).unwrap_err().to_string();
        assert!(
            error.contains("ZENOH_SESSION_CONFIG_URI=/nowhere.json5"),
            "{error}"
        );
    }
}
