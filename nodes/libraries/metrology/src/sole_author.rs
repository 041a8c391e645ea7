//! Who is followed on a topic that moves axes: one publisher, and nobody while two speak.
//!
//! Offsets of two publishers that are taken by turns move an axis to and fro between two wishes. So a controller
//! follows one author. Another one that is heard is waited with until the first has been silent for
//! [`TAKEN_OVER_AFTER`]: who was started anew takes over. Where both speak, nobody is followed until one has been alone
//! for [`ALONE_FOR`]. Messages decide, not who is known to the network: a killed process is known for a while yet.

use std::fmt;

use crate::stamp::{Host, Span, Stamp};

/// Who was heard last is followed by another one after this silence.
pub const TAKEN_OVER_AFTER: Span = Span::from_nanos(500_000_000);
/// After two have spoken, one is followed again when nobody else has been heard for this time.
pub const ALONE_FOR: Span = Span::from_nanos(2_000_000_000);

/// Authors that are remembered at a time; of more, the one heard longest ago is forgotten.
const MOST_AUTHORS: usize = 16;

/// A publisher by its identifier on the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Author(pub [u8; 16]);

impl fmt::Display for Author {
    /// As `ros2 topic info --verbose` writes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, byte) in self.0.iter().enumerate() {
            let dot = if place == 0 { "" } else { "." };
            write!(f, "{dot}{byte:02x}")?;
        }
        Ok(())
    }
}

/// What an audience has to say, once each time that it changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AuthorNews {
    /// Two speak: nobody is followed.
    Contested(Author, Author),
    /// One has been alone for a while: it is followed.
    Alone,
}

/// The one author of a topic.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SoleAuthor {
    /// Who was heard when, the last one at the end.
    heard: Vec<(Author, Stamp<Host>)>,
    author: Option<Author>,
    contested: Option<(Author, Author)>,
    reported: bool,
    /// Whether what was heard last is to be followed.
    follows: bool,
}

impl SoleAuthor {
    /// A message of `author` came, whether it can be used or not.
    pub fn hear(&mut self, at: Stamp<Host>, author: Author) {
        self.forget(at);
        let place = self.heard.iter().position(|(known, _)| *known == author);
        let before = self.heard.last().copied();
        if let (Some(_), Some((other, _))) = (place, before)
            && other != author
        {
            self.contested = Some((other, author));
        }
        if let Some(place) = place {
            self.heard.remove(place);
        } else if self.heard.len() >= MOST_AUTHORS {
            self.heard.remove(0);
        }
        let followed = self.author;
        let speaks = { self.heard.iter() }
            .any(|(known, last)| Some(*known) == followed && at - *last < TAKEN_OVER_AFTER);
        if !speaks {
            self.author = Some(author);
        }
        self.heard.push((author, at));
        self.follows = self.author == Some(author);
    }

    /// Time has passed: what has changed.
    pub fn tick(&mut self, at: Stamp<Host>) -> Option<AuthorNews> {
        self.forget(at);
        match self.contested {
            Some((one, other)) if !self.reported => {
                self.reported = true;
                Some(AuthorNews::Contested(one, other))
            }
            None if self.reported => {
                self.reported = false;
                Some(AuthorNews::Alone)
            }
            _ => None,
        }
    }

    /// Who speak by turns; nobody is followed then.
    #[must_use]
    pub const fn contested(&self) -> Option<(Author, Author)> {
        self.contested
    }

    /// Whether the message that was heard last is followed. Where nobody is ever told apart, everything is.
    #[must_use]
    pub const fn follows_last(&self) -> bool {
        self.contested.is_none() && (self.author.is_none() || self.follows)
    }

    fn forget(&mut self, at: Stamp<Host>) {
        // The clock may be set back.
        for (_, last) in &mut self.heard {
            *last = (*last).min(at);
        }
        self.heard.retain(|(_, last)| at - *last < ALONE_FOR);
        if self.contested.is_some() && self.heard.len() <= 1 {
            self.contested = None;
            self.author = self.heard.first().map(|(author, _)| *author);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Author = Author([1; 16]);
    const B: Author = Author([2; 16]);

    fn at(time_ms: i64) -> Stamp<Host> {
        Stamp::from_nanos(1_700_000_000_000_000_000 + time_ms * 1_000_000)
    }

    #[test]
    fn one_author_is_followed_and_one_that_is_started_anew_takes_over() {
        let mut sole = SoleAuthor::default();
        assert!(sole.follows_last(), "nobody is told apart");
        for n in 0..50 {
            sole.hear(at(n * 20), A);
            assert!(sole.follows_last());
        }
        // Killed, and started anew at once or later: waited with, then followed, and never contested.
        for silent_ms in [30, 499, 500, 700, 3_000] {
            let mut sole = sole.clone();
            for n in 0..100 {
                let since_ms = silent_ms + n * 20;
                sole.hear(at(980 + since_ms), B);
                assert_eq!(sole.follows_last(), since_ms >= 500, "{since_ms} ms");
                assert_eq!(sole.tick(at(980 + since_ms)), None);
            }
        }
    }

    #[test]
    fn two_who_speak_are_not_followed_until_one_has_been_alone() {
        // Both often, one seldom, both seldom.
        for (a_ms, b_ms) in [(20, 20), (20, 1_900), (10, 5_000), (900, 1_100), (1_000, 7)] {
            let (mut sole, mut since) = (SoleAuthor::default(), None);
            let mut followed_b = 0;
            for time_ms in 0..20_000 {
                for (author, every_ms) in [(A, a_ms), (B, b_ms)] {
                    if time_ms % every_ms == every_ms / 2 {
                        sole.hear(at(time_ms), author);
                        let is_b = author == B && sole.follows_last();
                        followed_b += usize::from(is_b && since.is_some());
                    }
                }
                match sole.tick(at(time_ms)) {
                    Some(AuthorNews::Contested(one, other)) => {
                        assert_ne!(one, other);
                        since = Some(time_ms);
                    }
                    Some(AuthorNews::Alone) => assert!(b_ms > 2_000, "{a_ms} {b_ms}"),
                    None => {}
                }
            }
            assert!(since.is_some(), "{a_ms} {b_ms}");
            assert_eq!(followed_b, 0, "{a_ms} {b_ms}");
            // The second falls silent.
            let mut over = None;
            for time_ms in 20_000..25_000 {
                if time_ms % 50 == 0 {
                    sole.hear(at(time_ms), A);
                    assert_eq!(
                        sole.follows_last(),
                        over.is_some() || sole.contested.is_none()
                    );
                }
                if sole.tick(at(time_ms)) == Some(AuthorNews::Alone) {
                    over = Some(time_ms);
                }
            }
            sole.hear(at(25_000), A);
            assert!(sole.follows_last() && sole.contested().is_none());
            assert!(
                over.is_none_or(|over| (21_000..22_001).contains(&over)),
                "{over:?}"
            );
        }
    }

    #[test]
    fn authors_without_end_and_clocks_that_are_set_leave_no_author_followed_by_mistake() {
        let mut sole = SoleAuthor::default();
        for n in 0..10_000_u32 {
            let mut other = [0; 16];
            other[..4].copy_from_slice(&n.to_le_bytes());
            other[15] = 9;
            sole.hear(at(i64::from(n)), A);
            sole.hear(at(i64::from(n)), Author(other));
            assert!(sole.heard.len() <= MOST_AUTHORS);
        }
        assert!(sole.contested().is_some());
        // An hour back: one alone again is followed after the same time.
        let back_ms = -3_600_000;
        for n in 0..150 {
            sole.hear(at(back_ms + n * 20), A);
            sole.tick(at(back_ms + n * 20));
        }
        assert!(sole.follows_last());
    }

    #[test]
    fn an_author_is_written_as_ros_writes_it() {
        let mut id = [0; 16];
        (id[0], id[1], id[15]) = (1, 0x0f, 0xff);
        assert_eq!(
            Author(id).to_string(),
            "01.0f.00.00.00.00.00.00.00.00.00.00.00.00.00.ff"
        );
    }
}
