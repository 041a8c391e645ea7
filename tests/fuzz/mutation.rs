//! Changes of bytes by a seed.

use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Longest input.
const LONGEST: usize = 1 << 16;

/// Numbers at which readers go wrong.
const NUMBERS: [&str; 18] = [
    "0",
    "-0",
    "1",
    "-1",
    "1e308",
    "-1e308",
    "1e309",
    "1e-320",
    "NaN",
    "inf",
    "-inf",
    ".",
    "-",
    "4294967296",
    "18446744073709551616",
    "9223372036854775807",
    "2147483648",
    "1e18",
];

/// Lengths and counts at which readers go wrong.
const COUNTS: [u64; 8] = [
    0,
    1,
    0x7f,
    0xffff,
    0x7fff_ffff,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    u64::MAX,
];

/// Makes inputs of those that it is given.
pub struct Mutator<'s> {
    rng: Pcg64Mcg,
    seeds: &'s [Vec<u8>],
}

impl<'s> Mutator<'s> {
    pub fn new(seed: u64, seeds: &'s [Vec<u8>]) -> Self {
        let rng = Pcg64Mcg::seed_from_u64(seed);
        Self { rng, seeds }
    }

    /// One more input.
    pub fn next(&mut self) -> Vec<u8> {
        let mut bytes = self.seed();
        for _ in 0..self.rng.random_range(1..=6) {
            self.change(&mut bytes);
        }
        bytes.truncate(LONGEST);
        bytes
    }

    fn seed(&mut self) -> Vec<u8> {
        let seed = self.seeds.choose(&mut self.rng);
        seed.cloned().unwrap_or_default()
    }

    fn place(&mut self, bytes: &[u8]) -> usize {
        self.rng.random_range(0..=bytes.len())
    }

    /// A stretch of at most `longest` bytes.
    fn stretch(&mut self, bytes: &[u8], longest: usize) -> std::ops::Range<usize> {
        let begin = self.place(bytes);
        let rest = (bytes.len() - begin).min(longest);
        begin..begin + self.rng.random_range(0..=rest)
    }

    fn change(&mut self, bytes: &mut Vec<u8>) {
        match self.rng.random_range(0..9) {
            0 if !bytes.is_empty() => {
                let at = self.rng.random_range(0..bytes.len());
                bytes[at] ^= 1 << self.rng.random_range(0..8);
            }
            1 if !bytes.is_empty() => {
                let at = self.rng.random_range(0..bytes.len());
                bytes[at] = self.rng.random();
            }
            2 => {
                let count = COUNTS.choose(&mut self.rng).copied().unwrap_or(0);
                let width = *[1, 2, 4, 8].choose(&mut self.rng).unwrap_or(&4);
                let at = self.place(bytes);
                let end = (at + width).min(bytes.len());
                let written = count.to_le_bytes();
                bytes[at..end].copy_from_slice(&written[..end - at]);
            }
            3 => {
                let cut = self.stretch(bytes, 64);
                bytes.drain(cut);
            }
            4 => {
                let copied = self.stretch(bytes, 256);
                let copied = bytes[copied].to_vec();
                let at = self.place(bytes);
                bytes.splice(at..at, copied);
            }
            5 => {
                let other = self.seed();
                let taken = self.stretch(&other, 1024);
                let at = self.place(bytes);
                bytes.splice(at..at, other[taken].to_vec());
            }
            6 => {
                let at = self.place(bytes);
                bytes.truncate(at);
            }
            7 => self.change_number(bytes),
            _ => {
                let many = self.rng.random_range(1..16);
                let noise: Vec<u8> = (0..many).map(|_| self.rng.random()).collect();
                let at = self.place(bytes);
                bytes.splice(at..at, noise);
            }
        }
    }

    /// Puts another number where one is written in figures.
    fn change_number(&mut self, bytes: &mut Vec<u8>) {
        let from = self.place(bytes);
        let is_figure = |byte: &u8| byte.is_ascii_digit() || *byte == b'.' || *byte == b'-';
        let Some(begin) = bytes[from..].iter().position(is_figure) else {
            return;
        };
        let begin = from + begin;
        let length = bytes[begin..].iter().take_while(|byte| is_figure(byte));
        let end = begin + length.count();
        let number = NUMBERS.choose(&mut self.rng).copied().unwrap_or("0");
        bytes.splice(begin..end, number.bytes());
    }
}
