//! A cell of three hosts by the secured configuration that is shipped, and a stranger on its network.
//!
//! Certificates are made as docs/deploy.md shows.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use abbe_msgs::{Message, topics};
use abbe_tests::hosts::bag;
use abbe_tests::hosts::network::{Network, address};
use abbe_tests::program::{Process, root};
use abbe_tests::scenario::Scenario;
use serde_json::Value;

/// The last has no certificate of the cell.
const HOSTS: [&str; 4] = ["controller", "models", "archive", "stranger"];
const DOMAIN: u16 = 66;
/// Until everybody has met, and the controller hears the compensation.
const MEETING: Duration = Duration::from_secs(6);
/// Longest run of a stranger: Python, refusals (4 s) and what it does.
const STRANGER: Duration = Duration::from_secs(40);
/// While somebody else is a stranger.
const LISTENS_S: &str = "12";

/// Makes an authority `ca` and certificates that it signs.
struct Authority<'f> {
    folder: &'f Path,
    ca: &'static str,
}

impl<'f> Authority<'f> {
    fn new(folder: &'f Path, ca: &'static str) -> Self {
        let made = Self { folder, ca };
        let subject = format!("/CN={ca}");
        let key = [
            "-keyout",
            &format!("{ca}.key"),
            "-out",
            &format!("{ca}.pem"),
        ]
        .map(str::to_owned);
        let mut words = own_words(
            "req -x509 -days 30 -nodes -newkey ec -pkeyopt ec_paramgen_curve:P-256 -subj",
        );
        words.push(subject);
        words.extend(key);
        made.openssl(&words);
        made
    }

    fn openssl(&self, words: &[String]) {
        let mut command = Command::new("openssl");
        let output = command
            .args(words)
            .current_dir(self.folder)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.success(),
            "openssl {}: {said}",
            words.join(" ")
        );
    }

    /// The certificate `file` of a host `name` with an address.
    fn signs(&self, file: &str, name: &str, address: &str) {
        let ca = self.ca;
        let names = format!("subjectAltName=DNS:{name},IP:{address}\n");
        std::fs::write(self.folder.join("names"), names).unwrap();
        let mut words = own_words("req -nodes -newkey ec -pkeyopt ec_paramgen_curve:P-256");
        words.extend(own_words(&format!(
            "-subj /CN={name} -keyout {file}.key -out {file}.csr"
        )));
        self.openssl(&words);
        let mut words = own_words(&format!(
            "x509 -req -days 30 -in {file}.csr -out {file}.pem"
        ));
        words.extend(own_words(&format!(
            "-CA {ca}.pem -CAkey {ca}.key -CAcreateserial -extfile names"
        )));
        self.openssl(&words);
    }
}

fn own_words(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

/// What a stranger is asked to do.
struct Stranger<'n> {
    network: &'n Network,
    python: &'n Path,
    folder: &'n Path,
}

impl Stranger<'_> {
    fn begin(&self, host: &str, endpoint: &str, certificate: &str, verb: [&str; 3]) -> Process {
        let folder = if endpoint.starts_with("tls") {
            self.folder.display().to_string()
        } else {
            "-".to_owned()
        };
        let file = root().join("tests/peers/zenoh_stranger.py");
        let mut words = vec![file.display().to_string(), endpoint.to_owned(), folder];
        words.extend([certificate, verb[0], verb[1], verb[2]].map(str::to_owned));
        let python = self.python.display().to_string();
        self.network.program(host, &python, &words)
    }

    /// What it printed.
    fn end(process: Process) -> Value {
        let said = process.ended_within(STRANGER).said;
        let line = said.lines().find(|line| line.starts_with('{'));
        serde_json::from_str(line.unwrap_or_else(|| panic!("{said}"))).unwrap()
    }

    /// From the stranger's computer to the controller's router.
    fn does(&self, endpoint: &str, certificate: &str, verb: [&str; 3]) -> Value {
        Self::end(self.begin("stranger", endpoint, certificate, verb))
    }
}

/// Runs it; `None` where this computer has no network namespaces, else whether strangers were kept out.
pub fn keeps_strangers_out(python: &PathBuf) -> Option<bool> {
    let mut network = Network::of(&HOSTS, DOMAIN, 20_261_130)?;
    let scenario = Scenario::copy_of("short_cell");
    let folder = scenario.path("tls");
    std::fs::create_dir(&folder).unwrap();
    let cell = Authority::new(&folder, "ca");
    for (place, host) in HOSTS.iter().enumerate().take(3) {
        cell.signs(host, host, &address(place));
    }
    network.over_secured_zenoh(python, &folder);
    // One with the name of a host that may do everything, of an authority that nobody trusts.
    Authority::new(&folder, "other").signs("forged", "models", &address(3));

    let into = scenario.path("bag");
    let record = ["-p".to_owned(), format!("bag:={}", into.display())];
    let of_file = |node: &str| {
        let file = scenario.argument(&format!("{node}.yaml"));
        ["--params-file".to_owned(), file]
    };
    let nodes = [
        network.node("archive", "recorder", &record),
        network.node("models", "axis_compensation", &of_file("axis_compensation")),
        network.node("controller", "fake_cnc", &of_file("fake_cnc")),
    ];
    std::thread::sleep(MEETING);
    let stranger = Stranger {
        network: &network,
        python,
        folder: &folder,
    };
    let is_kept_out = judge(&stranger);
    for node in nodes.into_iter().rev() {
        node.stop();
    }
    let heard = [topics::AXES_STATE.name, topics::COMPENSATION.name]
        .map(|topic| bag::numbers(&into, topic).len());
    eprintln!(
        "  the archive recorded {} states, {} offsets",
        heard[0], heard[1]
    );
    Some(is_kept_out && heard.iter().all(|count| *count > 20))
}

/// Lets strangers try; whether each got what it may have, and no more.
fn judge(stranger: &Stranger<'_>) -> bool {
    let description = <abbe_msgs::msg::AxisCompensation as Message>::DESCRIPTION;
    let offsets = format!(
        "{DOMAIN}/compensation/abbe_msgs::msg::dds_::AxisCompensation_/{}",
        description.type_hash
    );
    let states = format!("{DOMAIN}/axes/state/*/*");
    let enable = format!("{DOMAIN}/axis_compensation/enable/*/*");
    let [tcp, tls] =
        [("tcp", 7447), ("tls", 7448)].map(|(link, port)| format!("{link}/{}:{port}", address(0)));
    let [hear, put, ask] = [
        ["hear", &states, "2"],
        ["put", &offsets, "50"],
        ["ask", &enable, "3"],
    ];

    let is_refused = |what: &str, seen: Value| {
        eprintln!("  {what}: {seen}");
        seen.get("refused").is_some()
    };
    let mut is_well = is_refused("past TLS", stranger.does(&tcp, "-", hear));
    is_well &= is_refused("no certificate", stranger.does(&tls, "-", hear));
    is_well &= is_refused("forged certificate", stranger.does(&tls, "forged", hear));

    let states_heard = stranger.does(&tls, "archive", hear);
    eprintln!("  the archive's certificate, states: {states_heard}");
    is_well &= states_heard["cell"].as_u64() > Some(0);
    for (certificate, may_write) in [("archive", false), ("models", true)] {
        let local = ["hear", &offsets, LISTENS_S];
        let listener = stranger.begin("controller", "tcp/localhost:7447", "-", local);
        let said = stranger.does(&tls, certificate, put);
        let answers = stranger.does(&tls, certificate, ask);
        let heard = Stranger::end(listener);
        eprintln!("  {certificate}'s certificate: {said}, {answers}, the controller heard {heard}");
        is_well &= heard["cell"].as_u64() > Some(0);
        is_well &= (heard["strangers"].as_u64() > Some(0)) == may_write;
        is_well &= (answers["answers"].as_u64() > Some(0)) == may_write;
    }
    is_well
}
