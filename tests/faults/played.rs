//! A bag is not played among those who speak on its topics or move axes by them.

use std::time::{Duration, Instant};

use abbe_msgs::topics;
use abbe_tests::graph::{Graph, port};
use abbe_tests::namespace;
use abbe_tests::program::{Ended, Process, command, domain, root};
use abbe_tests::scenario::Scenario;

const END: Duration = Duration::from_secs(60);

fn play(domain: u16, options: &[&str]) -> Process {
    let mut play = command(domain, &["play"]);
    play.arg(root().join("bags/cold_reference")).args(options);
    Process::start(play)
}

/// The output has each of the words, and nothing was played.
fn is_refused(ended: &Ended, words: &[&str]) {
    assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
    for word in words {
        assert!(ended.said.contains(word), "{word}: {}", ended.said);
    }
}

#[test]
fn a_bag_is_not_played_where_another_publishes_its_topics_and_stops_when_one_comes() {
    namespace::alone("a bag among other publishers", || {
        let domain = domain(16);
        let graph = Graph::join(domain);
        let states = port(&topics::AXES_STATE);
        let voice = graph.voice(std::slice::from_ref(&states));
        let began = Instant::now();
        let words = ["/voice publishes /axes/state", "--onto-a-running-graph"];
        let refused = play(domain, &["--rate", "0"]).ended_within(END);
        is_refused(&refused, &words);
        is_refused(&refused, &["0 messages were sent"]);
        assert!(graph.since(&topics::AXES_STATE, began).is_empty());
        for allowed in [
            &["--topics", "/probe/*", "--no-clock"][..],
            &["--topics", "/axes/state", "--onto-a-running-graph"],
        ] {
            let played = play(domain, &[&["--rate", "0"], allowed].concat());
            let ended = played.ended_within(END);
            assert_eq!(ended.status.code(), Some(0), "{allowed:?}: {}", ended.said);
        }
        voice.stop();
        // One that comes while it is played.
        let since = Instant::now();
        let playing = play(domain, &["--loop"]);
        graph.next(&topics::AXES_STATE, since, |_| true);
        let voice = graph.voice(std::slice::from_ref(&states));
        is_refused(&playing.ended_within(END), &words);
        voice.stop();
    });
}

#[test]
fn a_bags_offsets_are_not_played_to_a_controller() {
    namespace::alone("offsets of a bag beside a controller", || {
        let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(17));
        let graph = Graph::join(domain);
        let began = Instant::now();
        let file = scenario.argument("fake_cnc.yaml");
        let node = Process::node(domain, "fake_cnc", &["--params-file", &file]);
        graph.alive("fake_cnc", began);
        let options = ["--topics", "/compensation", "--no-clock"];
        let refused = play(domain, &options).ended_within(END);
        is_refused(&refused, &["/fake_cnc moves its axes by /compensation"]);
        assert!(graph.since(&topics::COMPENSATION, began).is_empty());
        node.stop();
    });
}
