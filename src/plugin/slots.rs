//! What each frame in flight leaves for the host to read.

use std::sync::Arc;

use super::mark::Mark;
use crate::gpu::{self, Buffer, Commands, Device, Memory};
use crate::render::{ERROR_WORKGROUPS, FEWEST_SAMPLES_FOR_ERROR, PathTracer};

/// How a render stood after a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// Samples a pixel that are in the frame's picture.
    pub samples: u32,
    /// The estimated relative error of that picture, as of [`crate::render::Renderer::estimate_error`]; from the fourth sample
    /// on, where the frame asked for it.
    pub error: Option<f64>,
    /// Samples so far that were NaN or infinite; they count as black.
    pub rejected: u32,
}

/// Words of a slot: the partial sums of the error, the rejected samples, the mark.
const REJECTED: u64 = ERROR_WORKGROUPS as u64;
const MARK: u64 = REJECTED + 1;
/// Bytes from slot to slot.
const STRIDE: u64 = 512;

/// One slot for each frame in flight, in memory that the host reads.
pub(super) struct Slots {
    buffer: Buffer,
    frames: Vec<Frame>,
}

/// What the host knows of the frame in a slot.
#[derive(Clone, Copy, Default)]
struct Frame {
    ticket: u64,
    samples: u32,
    pixels: u64,
    has_error: bool,
}

impl Slots {
    pub(super) fn new(device: &Arc<Device>, count: u32) -> gpu::Result<Slots> {
        let buffer = Buffer::new(device, "frame status", STRIDE * u64::from(count), Memory::Readback)?;
        Ok(Slots { buffer, frames: vec![Frame::default(); count as usize] })
    }

    fn offset(&self, ticket: u64) -> u64 {
        ticket % self.frames.len() as u64 * STRIDE
    }

    /// Takes the slot of that recording, which must be free.
    pub(super) fn begin(&mut self, ticket: u64) {
        let place = (self.offset(ticket) + 4 * MARK) as usize;
        if let Some(word) = self.buffer.mapped_mut().and_then(|bytes| bytes.get_mut(place..place + 4)) {
            word.copy_from_slice(&Mark::Waiting.word().to_le_bytes());
        }
    }

    /// Records that the device has come so far. A barrier stands before it.
    pub(super) fn record_mark(&self, commands: &mut Commands, ticket: u64, mark: Mark) {
        let place = self.offset(ticket) + 4 * MARK;
        commands.fill(&self.buffer, place..place + 4, mark.word());
    }

    /// Records what [`Slots::status`] will say.
    pub(super) fn record_status(
        &self,
        commands: &mut Commands,
        ticket: u64,
        tracer: &PathTracer,
        samples: u32,
        has_error: bool,
    ) {
        let offset = self.offset(ticket);
        if has_error && samples >= FEWEST_SAMPLES_FOR_ERROR {
            tracer.record_error(commands, samples, self.buffer.address() + offset);
        }
        commands.copy(tracer.film().rejected(), 0, &self.buffer, offset + 4 * REJECTED, 4);
    }

    /// The frame was recorded.
    pub(super) fn keep(&mut self, ticket: u64, pixels: u64, samples: u32, has_error: bool) {
        let place = ticket as usize % self.frames.len();
        let has_error = has_error && samples >= FEWEST_SAMPLES_FOR_ERROR;
        self.frames[place] = Frame { ticket, samples, pixels, has_error };
    }

    /// That recording and those after it come to nothing.
    pub(super) fn forget(&mut self, ticket: u64) {
        let later = self.frames.iter_mut().filter(|frame| frame.ticket >= ticket);
        later.for_each(|frame| *frame = Frame::default());
    }

    /// What the frame left, once it is done; `None` if the ticket is no frame's, or its slot was taken by another.
    pub(super) fn status(&self, ticket: u64) -> Option<Status> {
        let frame = self.frames[ticket as usize % self.frames.len()];
        if frame.ticket != ticket || ticket == 0 {
            return None;
        }
        let words = self.words(ticket)?;
        let error = frame.has_error.then(|| {
            let sums = words[..REJECTED as usize].iter().map(|word| f64::from(f32::from_le_bytes(*word)));
            sums.sum::<f64>() / frame.pixels as f64
        });
        Some(Status { samples: frame.samples, error, rejected: u32::from_le_bytes(words[REJECTED as usize]) })
    }

    /// How far the device has come with that recording.
    pub(super) fn mark(&self, ticket: u64) -> Mark {
        self.words(ticket).map_or(Mark::Waiting, |words| Mark::of(u32::from_le_bytes(words[MARK as usize])))
    }

    fn words(&self, ticket: u64) -> Option<&[[u8; 4]]> {
        let offset = self.offset(ticket) as usize;
        Some(self.buffer.mapped()?.get(offset..offset + STRIDE as usize)?.as_chunks().0)
    }
}
