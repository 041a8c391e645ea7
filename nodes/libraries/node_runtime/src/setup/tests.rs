#![expect(clippy::disallowed_methods, reason = "files of the tests")]

use std::fs;

use metrology::stamp::{Host, Stamp};
use schemars::JsonSchema;
use serde::Deserialize;

use super::*;

#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Config {
    /// How often.
    #[schemars(range(min = 1.0, max = 100.0))]
    rate_hz: f64,
    machine_file: String,
    /// How many.
    #[serde(default = "five")]
    count: u32,
}

const fn five() -> u32 {
    5
}

fn setup(yaml: &str, more: &[&str]) -> (tempfile::TempDir, Result<Setup, SetupError>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("probe.yaml");
    fs::write(&path, yaml).unwrap();
    fs::write(folder.path().join("machine.yaml"), "name: m").unwrap();
    let mut arguments = vec!["--ros-args", "--params-file", path.to_str().unwrap()];
    arguments.extend(more);
    let arguments = Arguments::parse(arguments.iter().map(|a| (*a).to_owned())).unwrap();
    let setup = Setup::new("probe", &arguments);
    (folder, setup)
}

const GOOD: &str = "/**:\n  ros__parameters:\n    rate_hz: 10.0\n    machine_file: machine.yaml\n    use_sim_time: true\n";

#[test]
fn file_and_command_line_make_one_configuration() {
    let (folder, setup) = setup(GOOD, &["-p", "rate_hz:=20.0", "-r", "__node:=bed"]);
    let setup = setup.unwrap();
    let config: Config = setup.config().unwrap();
    assert_eq!((config.rate_hz, config.count), (20.0, 5));
    assert!(setup.use_sim_time());
    assert_eq!(setup.name(), "bed");
    let (path, text) = setup.file_text("machine_file").unwrap();
    assert_eq!(
        (path, text.as_str()),
        (folder.path().join("machine.yaml"), "name: m")
    );
    let served = setup.resolved(&config).unwrap();
    let names: Vec<_> = served.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["count", "machine_file", "rate_hz", "use_sim_time"]);
    assert_eq!(served[0].value, Value::Integer(5));
    assert_eq!(served[2].value, Value::Double(20.0));
    assert_eq!(served[2].description, "How often. [Hz]");
}

#[test]
fn what_comes_from_outside_is_stamped_by_the_clock_of_the_node() {
    let at = |seconds: i64| {
        Stamp::<Host>::from_nanos(1_700_000_000_000_000_000 + seconds * 1_000_000_000)
    };
    let error = "{offset_s: 90.0, drift_us_per_s: 0.0, since_s: 1700000000.0}";
    let wrong = format!("clock_error:={error}");
    for (arguments, wanted) in [
        (&["-p", "use_sim_time:=false"][..], at(3)),
        (&["-p", "use_sim_time:=false", "-p", &wrong], at(93)),
        (&["-p", "use_sim_time:=true"], at(5)),
    ] {
        let (_folder, setup) = setup(GOOD, arguments);
        let clock = setup.unwrap().arrival_clock();
        assert_eq!(clock.shown(at(5), at(3)), wanted, "{arguments:?}");
    }
}

#[test]
fn a_parameter_that_the_node_does_not_know_is_refused_with_file_and_key() {
    let (_folder, setup) = setup(
        "probe:\n  ros__parameters: {rate_hz: 1.0, machine_file: m, rat_hz: 2.0}",
        &[],
    );
    let error = setup.unwrap().config::<Config>().unwrap_err().to_string();
    assert!(error.contains("probe.yaml"), "{error}");
    assert!(error.contains("`rat_hz` = 2.0"), "{error}");
}

#[test]
fn an_integer_is_no_double_and_the_error_says_who_said_so() {
    let (_folder, setup) = setup(GOOD, &["-p", "rate_hz:=3"]);
    let error = setup.unwrap().config::<Config>().unwrap_err().to_string();
    assert_eq!(
        error,
        "command line: parameter `rate_hz` = 3 Hz: expected a double, got the integer 3: write 3.0"
    );
}

#[test]
fn what_is_missing_is_named() {
    let (_folder, setup) = setup("/**:\n  ros__parameters: {rate_hz: 1.0}", &[]);
    let setup = setup.unwrap();
    assert!(
        setup
            .config::<Config>()
            .unwrap_err()
            .to_string()
            .contains("machine_file")
    );
    assert!(
        setup
            .file_text("machine_file")
            .unwrap_err()
            .to_string()
            .contains("machine_file")
    );
}

#[test]
fn a_value_outside_of_its_range_or_of_a_wrong_kind_is_refused() {
    let (_folder, setup) = setup(GOOD, &["-p", "rate_hz:=1000.0", "-p", "mixed:=[1, a]"]);
    let setup = setup.unwrap();
    let error = setup
        .parameters(&parameters_of::<Config>())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("`mixed`") && error.contains("one type"),
        "{error}"
    );
    let mut lone = setup.clone();
    lone.parameters.remove("mixed");
    let error = lone
        .parameters(&parameters_of::<Config>())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("`rate_hz` = 1000.0 Hz: must be 1 to 100"),
        "{error}"
    );
    let (_folder, bad) = self::setup(GOOD, &["-p", "use_sim_time:=1"]);
    assert!(bad.unwrap_err().to_string().contains("use_sim_time"));
}

#[test]
fn an_entry_of_a_list_outside_of_the_range_is_refused_with_its_place_and_value() {
    let range = Some((-1000.0, 1000.0));
    let doubles = Value::DoubleArray(vec![80.0, 1e308]);
    let integers = Value::IntegerArray(vec![-1001]);
    assert_eq!(
        check_range(&doubles, range),
        Err("entry [1] = 1e308: must be -1000 to 1000".to_owned())
    );
    assert_eq!(
        check_range(&integers, range),
        Err("entry [0] = -1001: must be -1000 to 1000".to_owned())
    );
    assert_eq!(check_range(&Value::DoubleArray(vec![80.0]), range), Ok(()));
}

#[test]
fn a_bad_default_is_said_with_the_file_that_does_not_set_it() {
    let config = Config {
        rate_hz: 1000.0,
        machine_file: String::new(),
        count: 5,
    };
    let refused = |setup: &Setup| setup.resolved(&config).unwrap_err().to_string();
    let (_folder, setup) = setup("/**:\n  ros__parameters: {count: 5}", &[]);
    let error = refused(&setup.unwrap());
    assert!(
        error.contains("probe.yaml (not set there: its default): parameter `rate_hz`"),
        "{error}"
    );
    let alone = Setup::new("probe", &Arguments::parse([]).unwrap()).unwrap();
    let error = refused(&alone);
    assert!(
        error.contains("no parameter file (its default): parameter `rate_hz`"),
        "{error}"
    );
}

#[test]
fn an_absent_parameter_file_is_named() {
    let arguments = ["--ros-args", "--params-file", "nowhere.yaml"].map(str::to_owned);
    let error = Setup::new("probe", &Arguments::parse(arguments).unwrap()).unwrap_err();
    assert!(error.to_string().contains("nowhere.yaml"));
}

#[test]
fn a_level_on_the_command_line_is_for_the_logger_that_it_names() {
    let level = |arguments: &[&str]| setup(GOOD, arguments).1.unwrap().log_level();
    assert_eq!(level(&["--log-level", "debug"]), None, "for the program");
    assert_eq!(level(&["--log-level", "rcl:=debug"]), None);
    let last = ["--log-level", "probe:=warn", "--log-level", "probe:=error"];
    assert_eq!(level(&last), Some(Severity::Error));
    let spaced = ["-r", "__ns:=/mill", "--log-level", "mill.probe:=trace"];
    assert_eq!(level(&spaced), Some(Severity::Debug));
}
