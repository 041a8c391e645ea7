//! A disk that fills up while a bag is written to it.

use std::path::Path;
use std::time::{Duration, Instant};

use abbe_msgs::topics;
use abbe_tests::graph::Graph;
use abbe_tests::namespace;
use abbe_tests::program::{Process, command, domain, root};
use abbe_tests::scenario::Scenario;
use nix::sys::signal::Signal;
use recorder::{Bag, Event, Order};

/// Size of the disk, KiB.
const DISK_KIB: u32 = 512;

/// Messages and losses of a bag.
fn content(bag: &Path) -> (u64, Vec<String>) {
    let bag = Bag::open(bag).unwrap();
    let mut events = bag.messages(Order::File);
    let (mut messages, mut losses) = (0, Vec::new());
    while let Some(event) = events.next_event() {
        match event {
            Event::Message(_) => messages += 1,
            Event::Loss(loss) => losses.push(loss.to_string()),
        }
    }
    (messages, losses)
}

/// The number before `word` in a text.
fn number_before(text: &str, word: &str) -> u64 {
    let before = text[..text.find(word).unwrap()].trim_end();
    let digits = before.rsplit(' ').next().unwrap();
    digits
        .parse()
        .unwrap_or_else(|_| panic!("{digits}: {text}"))
}

/// A machine that stands and says where a thousand times a second.
fn standing_machine() -> Scenario {
    let scenario = Scenario::copy_of("short_cell");
    scenario.replace("fake_cnc.yaml", "    background_rate_hz: 10.0\n", "");
    scenario
}

#[test]
fn a_recorder_whose_disk_fills_says_where_and_how_much_and_the_cell_goes_on() {
    namespace::alone("a recorder on a full disk", || {
        let (scenario, domain) = (standing_machine(), domain(5));
        let disk = scenario.path("disk");
        namespace::small_disk(&disk, DISK_KIB);
        let bag = disk.join("bag");
        let graph = Graph::join(domain);
        let file = scenario.argument("fake_cnc.yaml");
        let machine = Process::node(domain, "fake_cnc", &["--params-file", &file]);
        let place = format!("bag:={}", bag.display());
        let arguments = ["-p", &place, "-p", "writing.compression:=none"];
        let mut recorder = Process::node(domain, "recorder", &arguments);
        let began = Instant::now();
        let path = bag.join("bag_0.mcap").display().to_string();
        let patience = Duration::from_secs(40);
        let words = [path.as_str(), "no space", "messages"];
        let said = graph.condition_within(patience, "recorder", "recording", &words, began);
        // What it says to stay is there, and is all of the bag.
        let (messages, losses) = content(&bag);
        assert!(messages > 100, "{messages}");
        assert_eq!(losses.len(), 1, "{losses:?}");
        assert_eq!(
            number_before(&said.message, " messages are written"),
            messages
        );
        // The cell and the recorder go on; whoever looks later is told too.
        let later = Instant::now() + Duration::from_secs(1);
        graph.next(&topics::AXES_STATE, later, |_| true);
        graph.condition("recorder", "recording", &words, later);
        graph.alive("recorder", later);
        assert!(recorder.is_running());
        recorder.stop();
        assert_eq!(content(&bag).0, messages);
        machine.stop();
    });
}

#[test]
fn abbe_record_on_a_full_disk_ends_with_the_reason_and_exit_code_1() {
    namespace::alone("abbe record on a full disk", || {
        let (scenario, domain) = (standing_machine(), domain(6));
        let disk = scenario.path("disk");
        namespace::small_disk(&disk, DISK_KIB);
        let bag = disk.join("bag");
        let file = scenario.argument("fake_cnc.yaml");
        let machine = Process::node(domain, "fake_cnc", &["--params-file", &file]);
        let place = bag.display().to_string();
        let arguments = ["record", "-o", &place, "--compression", "none"];
        let record = Process::start(command(domain, &arguments));
        std::thread::sleep(Duration::from_secs(8));
        record.signal(Signal::SIGINT);
        let ended = record.ended_within(Duration::from_secs(20));
        eprintln!("{}", ended.said.trim());
        assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
        for word in ["bag_0.mcap", "no space"] {
            assert!(ended.said.contains(word), "{word}: {}", ended.said);
        }
        let (messages, losses) = content(&bag);
        assert!(messages > 100 && losses.len() == 1, "{messages} {losses:?}");
        machine.stop();
    });
}

/// Counts that the output reports for a bag: its messages, and those lost.
fn told_of_bag(said: &str) -> (u64, u64) {
    let line = said.lines().find(|line| line.starts_with("Bag:  "));
    let line = line.unwrap_or_else(|| panic!("{said}"));
    let counts = line.rsplit('(').next().unwrap();
    (
        number_before(&format!(" {counts}"), " messages"),
        number_before(counts, " lost"),
    )
}

#[test]
fn a_scenario_whose_disk_fills_is_called_off_and_tells_its_page_and_what_is_lost() {
    namespace::alone("a scenario on a full disk", || {
        for (name, kib) in [
            ("cold_reference", DISK_KIB / 2),
            ("first_run", 8 * DISK_KIB),
        ] {
            let scenario = Scenario::copy_of(name);
            namespace::small_disk(&scenario.out(), kib);
            let began = Instant::now();
            let ended = scenario.run_to_end(&[]);
            let took = began.elapsed();
            eprintln!("{took:?}: {}", ended.said.trim());
            assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
            for word in [
                "bag_0.mcap",
                "no space",
                "called off",
                "abbe: what did not go as planned",
            ] {
                assert!(ended.said.contains(word), "{word}: {}", ended.said);
            }
            let (messages, losses) = content(&scenario.new_run(&[]).join("bag"));
            assert!(messages > 100 && losses.len() == 1, "{messages} {losses:?}");
            let (told, lost) = told_of_bag(&ended.said);
            assert_eq!(told, messages, "{}", ended.said);
            // The reason has the same numbers, at the end as well.
            let words = format!("{messages} messages are written, {lost} messages are lost");
            assert!(ended.said.contains(&words), "{words}: {}", ended.said);
            assert!(lost > 0, "{}", ended.said);
            // Nothing half written stands beside the bag.
            let left = std::fs::read_dir(scenario.new_run(&[])).unwrap();
            let names = left.map(|entry| entry.unwrap().file_name().into_string().unwrap());
            let names: Vec<String> = names.collect();
            assert!(names.iter().all(|name| !name.contains(".new")), "{names:?}");
            // What is left is reported as not whole.
            let bag = scenario.new_run(&[]).join("bag").display().to_string();
            let report = Process::start(command(0, &["report", &bag]));
            let report = report.ended_within(Duration::from_secs(60));
            assert_eq!(report.status.code(), Some(3), "{}", report.said);
            assert!(report.said.contains("NOT WHOLE"), "{}", report.said);
        }
    });
}

#[test]
fn a_run_in_real_time_whose_disk_fills_says_so_on_diagnostics_and_winds_down() {
    namespace::alone("a run in real time on a full disk", || {
        namespace::multicast_on_loopback();
        let (scenario, domain) = (standing_machine(), domain(7));
        namespace::small_disk(&scenario.out(), DISK_KIB);
        let graph = Graph::join(domain);
        let began = Instant::now();
        let (folder, out) = (scenario.folder(), scenario.out());
        let [folder, out] = [folder, out].map(|path| path.display().to_string());
        let run = Process::start(command(domain, &["run", &folder, "--runs", &out]));
        let patience = Duration::from_secs(60);
        let words = ["no space", "bag_0.mcap", "called off"];
        graph.condition_within(patience, "abbe_run", "recording", &words, began);
        let ended = run.ended_within(Duration::from_secs(40));
        eprintln!("{}", ended.said.trim());
        assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
        let (messages, losses) = content(&scenario.new_run(&[]).join("bag"));
        assert!(messages > 100 && losses.len() == 1, "{messages} {losses:?}");
        assert_eq!(told_of_bag(&ended.said).0, messages, "{}", ended.said);
        for word in ["called off", "no space", "messages are lost"] {
            assert!(ended.said.contains(word), "{word}: {}", ended.said);
        }
    });
}

#[test]
fn what_does_not_fit_on_the_disk_leaves_no_half_file_and_an_error() {
    namespace::alone("verbs on a full disk", || {
        let home = tempfile::tempdir().unwrap();
        let disk = home.path().join("disk");
        namespace::small_disk(&disk, 4);
        let of = |path: &str| root().join(path).display().to_string();
        let [table, map, machine] = [
            "tests/import/ballbar.csv",
            "tests/import/ballbar.yaml",
            "launch_configs/gap_first/machine.yaml",
        ]
        .map(of);
        let bag = of("bags/dual_loop");
        let out = |name: &str| disk.join(name).display().to_string();
        let (of_import, of_new, of_page) = (out("bag"), out("machine.yaml"), out(""));
        let imported = ["import", &table, "--map", &map, "--machine", &machine];
        for arguments in [
            [&imported[..], &["-o", &of_import]].concat(),
            vec!["new-machine", &of_new],
            vec!["report", &bag, "--out", &of_page],
        ] {
            let ended = Process::start(command(0, &arguments));
            let ended = ended.ended_within(Duration::from_secs(60));
            assert_eq!(
                ended.status.code(),
                Some(1),
                "{arguments:?}: {}",
                ended.said
            );
            let said = ended.said.to_lowercase();
            assert!(said.contains("no space"), "{arguments:?}: {said}");
            let left: Vec<_> = std::fs::read_dir(&disk)
                .unwrap()
                .map(|entry| entry.unwrap().file_name())
                .collect();
            assert!(left.is_empty(), "{arguments:?}: {left:?}");
        }
    });
}
