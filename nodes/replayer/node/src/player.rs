//! The playing thread: reads the bag in flat memory and sends each message when it is due.

use std::path::Path;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use abbe_msgs::rosgraph_msgs::msg::Clock;
use abbe_msgs::to_cdr;
use anyhow::{Context, Result, anyhow};
use metrology::stamp::{Host, Span, Stamp};
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use node_runtime::tap::Rival;
use node_runtime::{Bytes, RawPublisher};
use recorder::{Bag, Event, MessageRef, Order};
use replayer::pause::Pause;
use replayer::{Account, Place, Playback, PlaybackConfig, Reason, TopicAccount};

use crate::contents::{Contents, Plan};
use crate::desk::{Desk, Next};
use crate::graph_watch::{GraphWatch, voice};
use crate::latched::Latched;

/// Messages between the reader and the network.
pub const QUEUE_LEN: usize = 4_096;
/// A network that takes nothing for so long loses messages, which are counted.
pub const PATIENCE: Duration = Duration::from_secs(5);
/// Time between two `/clock`.
const CLOCK_PERIOD: Duration = Duration::from_millis(25);
/// The same in time of the bag, where nothing is waited for.
const CLOCK_STEP: Span = Span::from_nanos(10_000_000);
/// As fast as subscribers acknowledge: so many messages are on the way at most.
const ON_THE_WAY: u64 = 64;

/// What playing came to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Played {
    /// Messages sent, `/clock` of the player not counted.
    pub messages: u64,
    /// Messages that were left out, that the network did not take, or that subscribers did not acknowledge in time.
    pub lost: u64,
    /// What was lost and left out, by topic and reason, and parts of the bag that could not be read, a sentence each.
    pub losses: Vec<String>,
}

/// A bag that is being played.
pub struct Player {
    desk: Arc<Desk>,
    thread: JoinHandle<()>,
}

impl Player {
    /// Opens the bag, joins the network as `names` and plays in a thread of its own.
    ///
    /// # Errors
    /// When a parameter is out of range, the bag cannot be opened or holds nothing of it, or there is no network.
    pub fn start(
        environment: &Environment,
        names: &NodeNames,
        config: &PlaybackConfig,
    ) -> Result<Self> {
        let playback = config.checked()?;
        let bag = Bag::open(Path::new(&config.bag))?;
        let contents = Contents::of(&bag, config, &playback, names)?;
        let publisher = voice(environment, names, &contents, config)?;
        let mut playing = Playing::new(bag, contents, publisher, config, &playback);
        let desk = Arc::clone(&playing.desk);
        let delay = Duration::from_nanos(u64::try_from(playback.delay.nanos()).unwrap_or(0));
        let thread = std::thread::Builder::new()
            .name("player".to_owned())
            .spawn(move || {
                playing.run(delay);
                playing.finish();
            })
            .context("thread that plays")?;
        Ok(Self { desk, thread })
    }

    /// Where it is steered and watched.
    pub fn desk(&self) -> Arc<Desk> {
        Arc::clone(&self.desk)
    }

    /// Ends it and waits until it has left the network. Not from within an event loop.
    ///
    /// # Errors
    /// When the playing thread panicked.
    pub fn finish(self) -> Result<()> {
        self.desk.stop();
        let ended = self.thread.join();
        ended.map_err(|_| anyhow!("the thread that plays panicked"))
    }
}

/// What speaks on the topics of a bag.
trait Voice {
    /// Says `data` on the topic at `place`.
    fn say(&mut self, place: usize, data: Bytes);

    /// Waits until what was said has been acknowledged; false when that took too long.
    fn settle(&self) -> bool;

    /// Other nodes on the graph, beside which nothing may be published.
    fn rivals(&self) -> Vec<Rival>;
}

impl Voice for RawPublisher {
    fn say(&mut self, place: usize, data: Bytes) {
        // What found no room in time is in its report at the end.
        self.publish(place, None, data);
    }

    fn settle(&self) -> bool {
        self.settle(PATIENCE)
    }

    fn rivals(&self) -> Vec<Rival> {
        self.rivals()
    }
}

struct Playing<V> {
    bag: Arc<Bag>,
    contents: Contents,
    desk: Arc<Desk>,
    voice: V,
    settles: bool,
    repeat: bool,
    /// What still holds of the time before the first one that is played.
    latched: Latched,
    told: Option<Instant>,
    told_at: Option<Stamp<Host>>,
    played: Played,
    /// By topic of the bag, of the first round.
    account: Account,
    is_first_round: bool,
    /// Time of the message before, within this round.
    before: Stamp<Host>,
    rate: Option<f64>,
    /// Times that subscribers did not acknowledge in time.
    unsettled: u64,
    watch: GraphWatch,
}

/// Whether the bag goes on.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Goes {
    On,
    Out,
}

impl<V: Voice> Playing<V> {
    fn new(
        bag: Bag,
        contents: Contents,
        voice: V,
        config: &PlaybackConfig,
        playback: &Playback,
    ) -> Self {
        let desk = Desk::new(contents.from, playback.rate, config.start_paused);
        let rows = bag.topics().iter();
        let rows = rows.map(|info| TopicAccount::new(&info.topic, &info.type_name));
        Self {
            account: Account {
                topics: rows.collect(),
            },
            is_first_round: true,
            before: contents.from,
            rate: playback.rate,
            unsettled: 0,
            watch: GraphWatch::new(config.onto_a_running_graph),
            bag: Arc::new(bag),
            contents,
            desk: Arc::new(desk),
            voice,
            settles: playback.rate.is_none(),
            repeat: config.repeat,
            latched: Latched::default(),
            told: None,
            told_at: None,
            played: Played::default(),
        }
    }

    fn run(&mut self, delay: Duration) {
        for wait in self.watch.waits(delay) {
            std::thread::park_timeout(wait);
            if self.is_disturbed() {
                return;
            }
        }
        while self.round() == Goes::On && self.repeat {
            self.is_first_round = false;
            self.before = self.contents.from;
            self.desk.again(self.contents.from);
        }
        self.settle();
    }

    /// The bag once, from its first message that is played to its last.
    fn round(&mut self) -> Goes {
        let bag = Arc::clone(&self.bag);
        let mut messages = bag.messages(Order::LogTime);
        let mut goes = Goes::On;
        while let Some(event) = messages.next_event() {
            match event {
                Event::Loss(loss) if self.is_first_round => {
                    self.played.losses.push(loss.to_string())
                }
                Event::Loss(_) => {}
                Event::Message(message) => {
                    goes = self.take(&message);
                    if goes == Goes::Out {
                        return goes;
                    }
                }
            }
        }
        self.send_latched();
        goes
    }

    fn take(&mut self, message: &MessageRef<'_>) -> Goes {
        let Some((place, at)) = self.playable(message) else {
            return Goes::On;
        };
        if at < self.contents.from {
            let qos = self.contents.offered[place].qos;
            self.latched.keep(place, qos, message.data);
            return Goes::On;
        }
        if at > self.contents.to {
            return Goes::On;
        }
        self.tell_pause(at);
        loop {
            if self.is_disturbed() {
                return Goes::Out;
            }
            match self.desk.next(at, CLOCK_PERIOD) {
                Next::Stop => return Goes::Out,
                Next::TellTime(now) => self.tell_time(now),
                Next::Send => break,
            }
        }
        if self.is_time_told_again(at) {
            self.tell_time(at);
        }
        self.send_latched();
        self.send(place, message.data.into());
        Goes::On
    }

    /// Its topic's place and its time, where it can be published; where not, it is left out and counted.
    fn playable(&mut self, message: &MessageRef<'_>) -> Option<(usize, Stamp<Host>)> {
        let topic = message.topic.index();
        let (place, unplayable) = match &self.contents.plans[topic] {
            Plan::Aside => return None,
            Plan::Play(place) => (Some(*place), unplayable(message)),
            Plan::LeftOut(reason, what) => (None, Some((*reason, what.clone()))),
        };
        let row = &mut self.account.topics[topic];
        row.messages += u64::from(self.is_first_round);
        let Some((reason, what)) = unplayable else {
            row.used += u64::from(self.is_first_round);
            let nanos = i64::try_from(message.log_time_nanos).unwrap_or(i64::MAX);
            return place.map(|place| (place, Stamp::from_nanos(nanos)));
        };
        if self.is_first_round {
            let first = Place {
                number: row.messages,
                log_time_nanos: message.log_time_nanos,
                stamp: None,
            };
            row.leave_out(reason, first, || what);
        }
        self.played.lost += 1;
        None
    }

    /// Whether somebody is on the graph among whom the bag may not be played.
    fn is_disturbed(&mut self) -> bool {
        let (voice, sent) = (&self.voice, self.played.messages);
        self.watch.is_disturbed(sent, || voice.rivals())
    }

    /// Says that nothing was recorded for long before the message of time `at`.
    fn tell_pause(&mut self, at: Stamp<Host>) {
        let before = std::mem::replace(&mut self.before, at);
        if let Some(rate) = self.rate
            && let Some(pause) = Pause::between(self.contents.first, before, at, rate)
        {
            self.desk.begin_pause(pause);
        }
    }

    fn send_latched(&mut self) {
        for (place, data) in self.latched.take() {
            self.send(place, data);
        }
    }

    fn send(&mut self, place: usize, data: Box<[u8]>) {
        self.voice.say(place, data.into());
        self.played.messages += 1;
        if self.settles && self.played.messages.is_multiple_of(ON_THE_WAY) {
            self.settle();
        }
    }

    fn settle(&mut self) {
        if !self.voice.settle() {
            self.played.lost += 1;
            self.unsettled += 1;
        }
    }

    fn is_time_told_again(&self, at: Stamp<Host>) -> bool {
        if self.settles {
            self.told_at
                .is_none_or(|told| at - told >= CLOCK_STEP || at < told)
        } else {
            self.told.is_none_or(|told| told.elapsed() >= CLOCK_PERIOD)
        }
    }

    #[expect(clippy::disallowed_methods, reason = "a bag is played against a clock")]
    fn tell_time(&mut self, at: Stamp<Host>) {
        let Some(place) = self.contents.clock else {
            return;
        };
        self.told = Some(Instant::now());
        self.told_at = Some(at);
        let clock = abbe_msgs::time(at);
        self.voice.say(place, to_cdr(&Clock { clock }).into());
    }
}

impl Playing<RawPublisher> {
    fn finish(self) {
        let Self {
            mut played,
            account,
            contents,
            unsettled,
            watch,
            ..
        } = self;
        played.losses.extend(account.lines());
        if unsettled > 0 {
            let patience_s = PATIENCE.as_secs();
            played.losses.push(format!(
                "{unsettled} times subscribers did not acknowledge within {patience_s} s what was sent"
            ));
        }
        let ended = self.voice.stop().map(|report| {
            played.lost += report.dropped + report.refused;
            played.losses.extend(report.unsent.iter().map(|unsent| {
                let topic = contents.offered.get(unsent.place);
                let topic = topic.map_or("", |topic| topic.name.as_str());
                format!(
                    "{topic}: {} messages not sent: {}",
                    unsent.samples, unsent.reason
                )
            }));
            played
        });
        let ended = ended.map_err(|error| format!("{error:#}"));
        self.desk.end(match watch.into_reason() {
            Some(reason) => Err(reason),
            None => ended,
        });
    }
}

/// Why the network would not take a message; `None`: it would.
fn unplayable(message: &MessageRef<'_>) -> Option<(Reason, String)> {
    if i64::try_from(message.log_time_nanos).is_err() {
        let what = "its log time is beyond the year 2262".to_owned();
        return Some((Reason::Stamp, what));
    }
    let what = match message.data {
        [0, 1, _, _, ..] => return None,
        [0, 0, _, _, ..] => "big-endian CDR (00 00): little-endian alone is sent".to_owned(),
        [high, low, _, _, ..] => {
            format!("encapsulation {high:02x} {low:02x}: must be 00 01 (little-endian plain CDR)")
        }
        short => format!(
            "{} bytes: the encapsulation header alone has 4",
            short.len()
        ),
    };
    Some((Reason::Encoding, what))
}

#[cfg(test)]
mod tests {
    use abbe_msgs::from_cdr;
    use metrology::stamp::NANOS_PER_S;
    use node_runtime::tap::Use;
    use recorder::{
        Channel, ChannelId, Directory, Durability, MessageStamp, QosProfile, RecorderConfig,
        Recording, Reliability, qos_to_yaml,
    };

    use super::*;

    /// Log time of the bag's first message, ns.
    const FIRST: i64 = 1_700_000_000 * NANOS_PER_S;
    /// The window that is played: 2 s to 3 s behind the first message, ns.
    const FROM: i64 = 2 * NANOS_PER_S;
    const TO: i64 = 3 * NANOS_PER_S;
    /// Topics with their durability and depth; the last one is not picked.
    const TOPICS: [(&str, Durability, u64); 4] = [
        ("/state", Durability::Volatile, 10),
        ("/model", Durability::TransientLocal, 2),
        ("/map", Durability::TransientLocal, 1),
        ("/other", Durability::TransientLocal, 1),
    ];
    /// Topic, log time behind the first message, ns, and what is said.
    const MESSAGES: [(&str, i64, u8); 17] = [
        ("/other", 0, 0),
        ("/map", FROM / 4, 1),
        ("/model", FROM / 4, 2),
        ("/state", FROM / 2, 3),
        ("/model", FROM / 2, 4),
        ("/model", FROM - 2, 5),
        ("/map", FROM - 1, 6),
        ("/state", FROM - 1, 7),
        ("/state", FROM, 8),
        ("/model", FROM + 1, 9),
        ("/other", FROM + 2, 10),
        ("/state", TO - 1, 11),
        ("/map", TO, 12),
        ("/state", TO, 13),
        ("/state", TO + 1, 14),
        ("/map", TO + 1, 15),
        ("/other", 2 * TO, 16),
    ];
    /// What a late subscriber is owed of the time before the window.
    const OWED: [u8; 3] = [4, 5, 6];

    /// A bag of [`MESSAGES`].
    fn bag(folder: &Path) -> Bag {
        let path = folder.join("bag");
        let directory = Directory::create(&path).unwrap();
        let mut recording = Recording::begin(directory, "bag", RecorderConfig::default()).unwrap();
        let mut channel = |(topic, durability, depth): (&str, Durability, u64)| {
            let qos = QosProfile::keep_last(depth, Reliability::Reliable, durability);
            let channel = Channel {
                topic: topic.to_owned(),
                type_name: "std_msgs/msg/String".to_owned(),
                type_hash: String::new(),
                definition: String::new(),
                qos_yaml: qos_to_yaml(&[qos]).unwrap(),
            };
            recording.add_channel(&channel).unwrap()
        };
        let ids: Vec<ChannelId> = TOPICS.into_iter().map(&mut channel).collect();
        for (topic, behind, says) in MESSAGES {
            let place = TOPICS.iter().position(|(name, ..)| *name == topic).unwrap();
            let stamp = MessageStamp {
                log_time_nanos: FIRST + behind,
                publish_time_nanos: FIRST + behind,
                sequence: 0,
            };
            let data = [0, 1, 0, 0, says];
            recording.write(ids[place], stamp, &data).unwrap();
        }
        recording.finish().unwrap();
        Bag::open(&path).unwrap()
    }

    /// A publisher without readers: its messages, and after how many of them another node publishes.
    #[derive(Default)]
    struct Said(Vec<(usize, Bytes)>, Option<usize>);

    impl Voice for Said {
        fn say(&mut self, place: usize, data: Bytes) {
            self.0.push((place, data));
        }

        fn settle(&self) -> bool {
            true
        }

        fn rivals(&self) -> Vec<Rival> {
            let rival = Rival {
                topic: "/state".to_owned(),
                uses: Use::Publishes,
                node: "/fake_cnc".to_owned(),
            };
            let comes = self.1.is_some_and(|after| self.0.len() >= after);
            comes.then_some(rival).into_iter().collect()
        }
    }

    /// What is said of the messages, and the times that `/clock` tells, ns behind the first message.
    fn played(window_s: (f64, Option<f64>), rate: f64) -> (Vec<u8>, Vec<i64>) {
        let home = tempfile::tempdir().unwrap();
        let bag = bag(home.path());
        let config = PlaybackConfig {
            topics: vec!["/state".to_owned(), "/m*".to_owned()],
            rate,
            from_s: window_s.0,
            to_s: window_s.1,
            ..PlaybackConfig::whole(String::new())
        };
        let playback = config.checked().unwrap();
        let names = NodeNames::new("player", &[]).unwrap();
        let contents = Contents::of(&bag, &config, &playback, &names).unwrap();
        let mut playing = Playing::new(bag, contents, Said::default(), &config, &playback);
        playing.run(Duration::ZERO);
        let clock = playing.contents.clock.unwrap();
        let (mut said, mut times) = (Vec::new(), Vec::new());
        for (place, data) in &playing.voice.0 {
            if *place == clock {
                let Clock { clock } = from_cdr(data).unwrap();
                let at = abbe_msgs::instant::<Host>(&clock).unwrap();
                times.push(at.nanos() - FIRST);
                continue;
            }
            let message = MESSAGES
                .iter()
                .find(|(_, _, says)| Some(says) == data.get(4));
            let topic = message.unwrap().0;
            assert_eq!(playing.contents.offered[*place].name, topic);
            said.push(data[4]);
        }
        assert_eq!(playing.played.messages, said.len() as u64);
        assert_eq!((playing.played.lost, playing.played.losses.len()), (0, 0));
        (said, times)
    }

    #[test]
    fn a_window_holds_the_messages_of_both_its_edges_behind_what_is_owed() {
        for rate in [0.0, 50.0] {
            let (said, times) = played((2.0, Some(3.0)), rate);
            assert_eq!(said, [&OWED[..], &[8, 9, 11, 12, 13]].concat(), "{rate}");
            assert_eq!(times[0], FROM, "{rate}");
            assert!(times.iter().all(|at| (FROM..=TO).contains(at)), "{times:?}");
        }
        let (said, times) = played((2.0, Some(2.0)), 0.0);
        assert_eq!(said, [&OWED[..], &[8]].concat());
        assert_eq!(times, [FROM]);
    }

    #[test]
    fn a_bag_is_not_played_among_others_before_or_after_its_first_message_unless_it_is_asked_for() {
        for (comes_after, is_allowed) in [(0, false), (3, false), (0, true), (3, true)] {
            let home = tempfile::tempdir().unwrap();
            let bag = bag(home.path());
            let config = PlaybackConfig {
                clock: false,
                rate: 10.0,
                onto_a_running_graph: is_allowed,
                ..PlaybackConfig::whole(String::new())
            };
            let playback = config.checked().unwrap();
            let names = NodeNames::new("player", &[]).unwrap();
            let contents = Contents::of(&bag, &config, &playback, &names).unwrap();
            let voice = Said(vec![], Some(comes_after));
            let mut playing = Playing::new(bag, contents, voice, &config, &playback);
            playing.run(Duration::ZERO);
            let said = playing.voice.0.len();
            let reason = playing.watch.into_reason();
            assert_eq!(reason.is_none(), is_allowed, "{reason:?}");
            if is_allowed {
                assert_eq!(said, MESSAGES.len());
                continue;
            }
            assert!((comes_after..MESSAGES.len()).contains(&said), "{said}");
            let reason = reason.unwrap();
            for words in [
                "/fake_cnc publishes /state",
                &format!("{said} messages were sent"),
                "--onto-a-running-graph",
            ] {
                assert!(reason.contains(words), "{words}: {reason}");
            }
        }
    }

    #[test]
    fn a_window_without_a_message_holds_what_is_owed() {
        let (said, times) = played((2.5, Some(2.75)), 0.0);
        assert_eq!(said, [5, 6, 9]);
        assert!(times.is_empty(), "{times:?}");
    }

    #[test]
    fn a_window_that_is_open_holds_every_message_that_is_picked() {
        let picked = MESSAGES.iter().filter(|(topic, ..)| *topic != "/other");
        let picked: Vec<u8> = picked.map(|(_, _, says)| *says).collect();
        assert_eq!(played((0.0, None), 0.0).0, picked);
    }
}
