//! The playing thread: reads the bag in flat memory and sends each message when it is due.

use std::path::Path;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::rosgraph_msgs::msg::Clock;
use abbe_msgs::to_cdr;
use anyhow::{Context, Result, anyhow};
use metrology::stamp::{Host, NANOS_PER_S, Span, Stamp};
use node_runtime::RawPublisher;
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use recorder::{Bag, Event, MessageRef, Order};
use replayer::PlaybackConfig;

use crate::contents::Contents;
use crate::desk::{Desk, Next};
use crate::latched::Latched;

/// Messages between the reader and the network.
const QUEUE_LEN: usize = 4_096;
/// A network that takes nothing for so long loses messages, which are counted.
const PATIENCE: Duration = Duration::from_secs(5);
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
    /// Messages that the network did not take, or that subscribers did not acknowledge in time.
    pub lost: u64,
    /// Parts of the bag that could not be read, a sentence each.
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
        let contents = Contents::of(&bag, config, &playback)?;
        let publisher =
            RawPublisher::of_found(environment, names, &contents.offered, QUEUE_LEN, PATIENCE)?;
        let desk = Arc::new(Desk::new(contents.from, playback.rate, config.start_paused));
        let mut playing = Playing {
            bag: Arc::new(bag),
            contents,
            desk: Arc::clone(&desk),
            publisher,
            settles: playback.rate.is_none(),
            repeat: config.repeat,
            latched: Latched::default(),
            told: None,
            told_at: None,
            played: Played::default(),
        };
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

struct Playing {
    bag: Arc<Bag>,
    contents: Contents,
    desk: Arc<Desk>,
    publisher: RawPublisher,
    settles: bool,
    repeat: bool,
    /// What still holds of the time before the first one that is played.
    latched: Latched,
    told: Option<Instant>,
    told_at: Option<Stamp<Host>>,
    played: Played,
}

/// Whether the bag goes on.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Goes {
    On,
    Out,
}

impl Playing {
    fn run(&mut self, delay: Duration) {
        std::thread::park_timeout(delay);
        let mut rounds = 0_u32;
        while self.round(rounds == 0) == Goes::On && self.repeat {
            rounds = rounds.saturating_add(1);
            self.desk.again(self.contents.from);
        }
        self.settle();
    }

    /// The bag once, from its first message that is played to its last.
    fn round(&mut self, first: bool) -> Goes {
        let bag = Arc::clone(&self.bag);
        let mut messages = bag.messages(Order::LogTime);
        let mut goes = Goes::On;
        while let Some(event) = messages.next_event() {
            match event {
                Event::Loss(loss) if first => self.played.losses.push(loss.to_string()),
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
        let Some(place) = self.contents.places[message.topic.index()] else {
            return Goes::On;
        };
        let nanos = i64::try_from(message.log_time_nanos).unwrap_or(i64::MAX);
        let at = Stamp::from_nanos(nanos);
        if at < self.contents.from {
            let qos = self.contents.offered[place].qos;
            self.latched.keep(place, qos, message.data);
            return Goes::On;
        }
        if at > self.contents.to {
            return Goes::On;
        }
        loop {
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

    fn send_latched(&mut self) {
        for (place, data) in self.latched.take() {
            self.send(place, data);
        }
    }

    fn send(&mut self, place: usize, data: Box<[u8]>) {
        self.publisher.publish(place, None, data.into());
        self.played.messages += 1;
        if self.settles && self.played.messages.is_multiple_of(ON_THE_WAY) {
            self.settle();
        }
    }

    fn settle(&mut self) {
        if !self.publisher.settle(PATIENCE) {
            self.played.lost += 1;
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
        let clock = Time {
            sec: i32::try_from(at.nanos().div_euclid(NANOS_PER_S)).unwrap_or(i32::MAX),
            nanosec: u32::try_from(at.nanos().rem_euclid(NANOS_PER_S)).unwrap_or(0),
        };
        self.publisher
            .publish(place, None, to_cdr(&Clock { clock }).into());
    }

    fn finish(self) {
        let ended = self.publisher.stop().map(|report| Played {
            lost: self.played.lost + report.dropped + report.refused,
            ..self.played
        });
        self.desk.end(ended.map_err(|error| format!("{error:#}")));
    }
}
