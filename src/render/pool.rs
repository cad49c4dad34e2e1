//! The path pool and its queues on the device.

use std::sync::Arc;

use super::error::Error;
use super::kernels::Features;
use super::layout::{PathPool, QueueCounter};
use super::material_record::Family;
use super::settings::Settings;
use crate::gpu::{Buffer, Commands, Memory, Upload};

/// A bounce's queues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Queue {
    /// Rays whose first hit is wanted.
    Trace,
    /// Light samples whose occlusion is wanted.
    Shadow,
    /// Paths that left the scene.
    Miss,
    /// Paths that hit a material of a family, and which of its queues takes them.
    Shade(Family, u32),
}

/// The first of the families' queues.
const QUEUE_SHADE: u32 = 3;

/// `MOST_QUEUES` of `glsl/lib/queue.glsl`.
const MOST_QUEUES: u32 = 32;
const _: () = assert!(QUEUE_SHADE + Family::ALL.len() as u32 + Features::MOST_NEUBRDF_QUEUES - 1 <= MOST_QUEUES);

/// Groups of four numbers that `glsl/lib/reuse.glsl` keeps of a path.
const REUSE_FIELDS: u64 = 8;

/// How many queues a bounce has.
fn queue_count(features: &Features) -> u32 {
    QUEUE_SHADE + features.families.count_ones() + features.neubrdf_queues - 1
}

impl Queue {
    /// Their order: `glsl/layout/path.glsl`. Families that the scene lacks have no queue; further ones of a family come last.
    fn index(self, features: &Features) -> u32 {
        match self {
            Queue::Trace => 0,
            Queue::Shadow => 1,
            Queue::Miss => 2,
            Queue::Shade(family, 0) => QUEUE_SHADE + features.place(family),
            Queue::Shade(_, further) => QUEUE_SHADE + features.families.count_ones() + further - 1,
        }
    }
}

/// A bounded number of paths in flight. Its memory depends on that number and the depth alone, not on the picture.
pub struct Pool {
    capacity: u32,
    table: PathPool,
    by_slot: [u64; 3],
    features: Features,
    counters: Buffer,
    empty_counters: Arc<Buffer>,
    // The table points to them.
    arrays: Vec<Buffer>,
}

impl Pool {
    /// Kernels count in 32 bits what the longest arrays hold: all queues, and what a path shares with others.
    pub fn most_paths(features: &Features) -> u32 {
        u32::MAX / queue_count(features).max(REUSE_FIELDS as u32)
    }

    /// Makes a pool of `capacity` paths (≥ 1, and no more than one dispatch has invocations), without what the scene and the
    /// settings have no use for.
    pub fn new(upload: &mut Upload, capacity: u32, settings: &Settings, features: &Features) -> Result<Pool, Error> {
        let device = &upload.device().clone();
        let mut arrays = Vec::new();
        let mut array = |name: &str, bytes: u64, wanted: bool| -> Result<u64, Error> {
            if !wanted {
                return Ok(0);
            }
            let buffer = Buffer::new(device, name, bytes * u64::from(capacity), Memory::Device)?;
            let address = buffer.address();
            arrays.push(buffer);
            Ok(address)
        };
        let lights = features.samples_lights();
        let queues = u64::from(queue_count(features));
        let bounces = u64::from(settings.max_depth) + 1;
        let empty = QueueCounter { groups: [0, 1, 1], count: 0 };
        let empty_counters = upload.buffer("empty queue counters", &vec![empty; (2 * bounces * queues) as usize])?;
        let counters = Buffer::new(device, "queue counters", empty_counters.size(), Memory::Device)?;
        let table = PathPool {
            origin: array("ray origins", 16, true)?,
            direction: array("ray directions", 16, true)?,
            throughput: array("throughputs", 16, true)?,
            radiance: array("radiances", 16, true)?,
            hit_key: array("hits and sample keys", 16, true)?,
            shadow_origin: array("shadow ray origins", 16, lights)?,
            shadow_direction: array("shadow ray directions", 16, lights)?,
            shadow_path: array("shadow ray paths", 8, lights)?,
            queue: array("queues", 4 * queues, true)?,
            counters: counters.address(),
        };
        let by_slot = [
            array("first albedos", 16, settings.features)?,
            array("first normals", 16, settings.features)?,
            array("path reuse", 16 * REUSE_FIELDS, settings.shares_paths())?,
        ];
        Ok(Pool { capacity, table, features: *features, by_slot, counters, empty_counters, arrays })
    }

    /// Paths in flight.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Its size on the device.
    pub fn bytes(&self) -> u64 {
        self.arrays.iter().chain([&self.counters, &*self.empty_counters]).map(Buffer::size).sum()
    }

    /// Where the kernels find its arrays.
    pub fn table(&self) -> PathPool {
        self.table
    }

    /// Where the kernels keep the albedo and the normal that each path saw first, 0 without feature channels, and what it shares with others, 0 where it
    /// shares nothing.
    pub fn by_slot(&self) -> [u64; 3] {
        self.by_slot
    }

    /// Empties all queues of all bounces.
    pub fn record_reset(&self, commands: &mut Commands) {
        commands.copy(&self.empty_counters, 0, &self.counters, 0, self.counters.size());
    }

    /// The indirect dispatch of a queue: its buffer and offset in bytes.
    pub fn counter(&self, bounce: u32, queue: Queue) -> (&Buffer, u64) {
        let index = u64::from(bounce * queue_count(&self.features) + queue.index(&self.features));
        (&self.counters, index * size_of::<QueueCounter>() as u64)
    }
}
