//! What a subscriber that comes late is owed: the last messages of latched topics from before the part that is played.

use abbe_msgs::{Durability, Qos};

/// Messages of latched topics, as many of each as it is deep, in their order.
#[derive(Debug, Default)]
pub(crate) struct Latched {
    kept: Vec<(usize, Box<[u8]>)>,
}

impl Latched {
    /// Keeps a message of the topic at `place`, unless nobody who comes later gets it.
    pub fn keep(&mut self, place: usize, qos: Qos, data: &[u8]) {
        if qos.durability != Durability::TransientLocal {
            return;
        }
        let of_topic = || self.kept.iter().filter(|(of, _)| *of == place);
        if of_topic().count() >= qos.depth as usize
            && let Some(oldest) = self.kept.iter().position(|(of, _)| *of == place)
        {
            self.kept.remove(oldest);
        }
        self.kept.push((place, data.into()));
    }

    /// Gives up all of them.
    pub fn take(&mut self) -> Vec<(usize, Box<[u8]>)> {
        std::mem::take(&mut self.kept)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use abbe_msgs::Reliability;

    fn qos(durability: Durability, depth: u32) -> Qos {
        Qos {
            reliability: Reliability::Reliable,
            durability,
            depth,
        }
    }

    #[test]
    fn as_many_as_a_topic_is_deep_are_kept_in_their_order() {
        let mut latched = Latched::default();
        let (latch, volatile) = (
            qos(Durability::TransientLocal, 2),
            qos(Durability::Volatile, 9),
        );
        for byte in 0..4_u8 {
            latched.keep(5, latch, &[byte]);
            latched.keep(6, volatile, &[byte]);
            if byte == 1 {
                latched.keep(2, qos(Durability::TransientLocal, 1), &[9]);
            }
        }
        let taken = latched.take();
        let bytes: Vec<(usize, u8)> = taken
            .iter()
            .map(|(place, data)| (*place, data[0]))
            .collect();
        assert_eq!(bytes, [(2, 9), (5, 2), (5, 3)]);
        assert!(latched.take().is_empty());
    }
}
