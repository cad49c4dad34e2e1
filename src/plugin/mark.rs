//! How far the device got: a word in host-visible memory that each frame's commands write as they go.

/// A part of a frame, in the order of the recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    /// Nothing of it has begun.
    Waiting,
    /// What changed is being uploaded.
    Upload,
    /// Depth and ids are being found.
    Probe,
    /// A bounce of a batch of paths.
    Bounce { batch: u32, bounce: u32 },
    /// The estimate, and the frame's way to its targets.
    Develop,
    /// All done.
    Done,
}

const BATCH_BITS: u32 = 20;
const BOUNCE_BITS: u32 = 8;

impl Mark {
    /// As a word; batches and bounces that do not fit count as the last that do.
    pub(super) fn word(self) -> u32 {
        let kind = |kind: u32| kind << (BATCH_BITS + BOUNCE_BITS);
        match self {
            Mark::Waiting => kind(0),
            Mark::Upload => kind(1),
            Mark::Probe => kind(2),
            Mark::Bounce { batch, bounce } => {
                kind(3) | batch.min((1 << BATCH_BITS) - 1) << BOUNCE_BITS | bounce.min((1 << BOUNCE_BITS) - 1)
            }
            Mark::Develop => kind(4),
            Mark::Done => kind(5),
        }
    }

    /// What a word says.
    pub(super) fn of(word: u32) -> Mark {
        match word >> (BATCH_BITS + BOUNCE_BITS) {
            1 => Mark::Upload,
            2 => Mark::Probe,
            3 => Mark::Bounce {
                batch: word >> BOUNCE_BITS & ((1 << BATCH_BITS) - 1),
                bounce: word & ((1 << BOUNCE_BITS) - 1),
            },
            4 => Mark::Develop,
            5 => Mark::Done,
            _ => Mark::Waiting,
        }
    }
}

impl std::fmt::Display for Mark {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Mark::Waiting => write!(f, "nothing yet"),
            Mark::Upload => write!(f, "upload"),
            Mark::Probe => write!(f, "probe"),
            Mark::Bounce { batch, bounce } => write!(f, "bounce {bounce} of batch {batch}"),
            Mark::Develop => write!(f, "develop"),
            Mark::Done => write!(f, "the end"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_says_what_was_put_in() {
        let last = Mark::Bounce { batch: (1 << BATCH_BITS) - 1, bounce: (1 << BOUNCE_BITS) - 1 };
        let first = Mark::Bounce { batch: 0, bounce: 0 };
        for mark in [Mark::Waiting, Mark::Upload, Mark::Probe, first, last, Mark::Develop, Mark::Done] {
            assert_eq!(Mark::of(mark.word()), mark);
        }
        assert_eq!(Mark::of(Mark::Bounce { batch: u32::MAX, bounce: u32::MAX }.word()), last);
    }
}
