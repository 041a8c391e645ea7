//! What parameters and tokens may be.

use live_view::{LiveViewConfig, Settings, checked_token};

fn refusal(change: impl FnOnce(&mut LiveViewConfig)) -> String {
    let mut config = LiveViewConfig::default();
    change(&mut config);
    Settings::new(&config).unwrap_err().to_string()
}

#[test]
fn an_address_that_others_reach_is_refused_without_a_token() {
    for address in ["0.0.0.0:8642", "192.168.1.5:80", "[::]:8642"] {
        let said = refusal(|config| config.address = address.to_owned());
        assert!(
            said.contains(address) && said.contains("token_file"),
            "{said}"
        );
        let config = LiveViewConfig {
            address: address.to_owned(),
            token_file: "token".to_owned(),
            ..LiveViewConfig::default()
        };
        assert!(Settings::new(&config).is_ok(), "{address}");
    }
    for address in ["127.0.0.1:8642", "[::1]:0", "127.3.0.1:1"] {
        let config = LiveViewConfig {
            address: address.to_owned(),
            ..LiveViewConfig::default()
        };
        assert!(Settings::new(&config).is_ok(), "{address}");
    }
}

#[test]
fn what_is_no_address_no_name_or_out_of_range_is_refused_by_name() {
    for address in ["", "localhost:80", "127.0.0.1", "127.0.0.1:99999"] {
        let said = refusal(|config| config.address = address.to_owned());
        assert!(said.starts_with("address = "), "{said}");
    }
    for name in ["", "mill:80", "a b", "*"] {
        let said = refusal(|config| config.host_names = vec![name.to_owned()]);
        assert!(said.starts_with("host_names: "), "{said}");
    }
    let said = refusal(|config| config.most_browsers = 0);
    assert!(said.starts_with("most_browsers = 0: must be"), "{said}");
    let said = refusal(|config| config.rate_hz = f64::NAN);
    assert!(said.starts_with("rate_hz = "), "{said}");
}

#[test]
fn a_token_is_one_line_that_is_hard_to_guess_and_no_error_has_it() {
    let token = "0123456789abcdefABC-._~";
    assert_eq!(checked_token("file", &format!("{token}\n")).unwrap(), token);
    for bad in [
        "short",
        "0123456789 0123456789 0",
        "0123456789\n0123456789x",
        "ä123456789012345678901",
    ] {
        let said = checked_token("file", bad).unwrap_err().to_string();
        assert!(
            said.starts_with("file: the token has") && !said.contains(bad),
            "{said}"
        );
    }
}
