//! Which kernels evaluate the NeuBRDFs of a scene, and in which queues paths wait for them.

use std::sync::Arc;

use super::kernels::Features;
use super::neubrdf_table::{NeuBrdfShape, neubrdf, neubrdfs};
use crate::gpu::Device;
use crate::scene::Brdf;
use crate::scene::brdf::{NeuBrdf, Precision};

/// How many queues a scene with these BRDFs needs for paths that hit NeuBRDFs, ≥ 1: a model each, unless there are too many.
pub fn neubrdf_queues(brdfs: &[Arc<Brdf>]) -> u32 {
    (neubrdfs(brdfs).count() as u32).clamp(1, Features::MOST_NEUBRDF_QUEUES)
}

/// What the kernels are built for that evaluate the NeuBRDFs of a scene, and which queues they serve. A model has a queue to itself and a kernel as
/// wide as it is, which models of the same shape share; where there are more models than queues, one kernel evaluates all.
#[derive(Clone, Debug, PartialEq)]
pub struct NeuBrdfKernels {
    shapes: Vec<NeuBrdfShape>,
    /// By BRDF of the scene; none where that is no NeuBRDF.
    queues: Vec<Option<u32>>,
    /// By queue, an index of `shapes`. Queues that no model has yet are not there.
    served_by: Vec<usize>,
}

impl NeuBrdfKernels {
    /// Those of a scene with these BRDFs. Where BRDFs may become others one of them is for the widest of all.
    pub fn of(brdfs: &[Arc<Brdf>], precision: Precision, may_change: bool) -> NeuBrdfKernels {
        if neubrdfs(brdfs).count() > Features::MOST_NEUBRDF_QUEUES as usize {
            return NeuBrdfKernels::one(brdfs, precision);
        }
        let mut kernels = NeuBrdfKernels::by(brdfs, |model| NeuBrdfShape::of([model], precision));
        if may_change || kernels.shapes.is_empty() {
            kernels.push(NeuBrdfShape::of(neubrdfs(brdfs), precision));
        }
        kernels
    }

    /// One for all.
    pub fn one(brdfs: &[Arc<Brdf>], precision: Precision) -> NeuBrdfKernels {
        let widest = NeuBrdfShape::of(neubrdfs(brdfs), precision);
        let mut kernels = NeuBrdfKernels::by(brdfs, |_| widest);
        kernels.push(widest);
        kernels
    }

    fn by(brdfs: &[Arc<Brdf>], shape: impl Fn(&NeuBrdf) -> NeuBrdfShape) -> NeuBrdfKernels {
        let mut kernels = NeuBrdfKernels { shapes: Vec::new(), queues: Vec::new(), served_by: Vec::new() };
        let mut queues = (0..Features::MOST_NEUBRDF_QUEUES).cycle();
        for brdf in brdfs {
            let served = neubrdf(brdf).map(|model| (kernels.push(shape(model)), queues.next().unwrap_or(0)));
            if let Some((kernel, queue)) = served
                && queue as usize == kernels.served_by.len()
            {
                kernels.served_by.push(kernel);
            }
            kernels.queues.push(served.map(|(_, queue)| queue));
        }
        kernels
    }

    /// The index of a shape, which is put there unless it is already.
    fn push(&mut self, shape: NeuBrdfShape) -> usize {
        self.shapes.iter().position(|known| *known == shape).unwrap_or_else(|| {
            self.shapes.push(shape);
            self.shapes.len() - 1
        })
    }

    /// The shapes for a device: [`NeuBrdfShape::on`].
    pub fn on(mut self, device: &Device) -> NeuBrdfKernels {
        self.shapes.iter_mut().for_each(|shape| *shape = shape.on(device));
        self
    }

    /// What the kernels are built for; at least one.
    pub fn shapes(&self) -> &[NeuBrdfShape] {
        &self.shapes
    }

    /// Which kernel serves a queue.
    pub fn serving(&self, queue: u32) -> usize {
        self.served_by.get(queue as usize).copied().unwrap_or(0)
    }

    /// The queue of paths that hit a BRDF; 0 for all that are no NeuBRDF.
    pub fn queue(&self, brdf: u32) -> u32 {
        self.queues.get(brdf as usize).copied().flatten().unwrap_or(0)
    }

    /// What the kernel of a NeuBRDF is built for.
    pub fn shape(&self, brdf: u32) -> &NeuBrdfShape {
        &self.shapes[self.serving(self.queue(brdf))]
    }

    /// Makes place for what BRDF `brdf` is now, one that was there or the next. False, and nothing is changed, if no kernel evaluates it.
    pub fn replace(&mut self, brdf: usize, now: &Brdf) -> bool {
        self.queues.resize(self.queues.len().max(brdf + 1), None);
        let Some(model) = neubrdf(now) else {
            self.queues[brdf] = None;
            return true;
        };
        let own = self.queues[brdf];
        let users = |queue: u32| self.queues.iter().filter(|other| **other == Some(queue)).count();
        let free = || (0..Features::MOST_NEUBRDF_QUEUES).find(|queue| users(*queue) == 0);
        let holds = |kernel: &usize| self.shapes[*kernel].holds(model);
        // A queue to itself may be served by another kernel, the narrowest.
        if let Some(queue) = own.filter(|queue| users(*queue) == 1).or_else(free) {
            let kernels = (0..self.shapes.len()).filter(holds);
            let Some(kernel) = kernels.min_by_key(|kernel| self.shapes[*kernel].products()) else { return false };
            self.served_by.resize(self.served_by.len().max(queue as usize + 1), 0);
            self.served_by[queue as usize] = kernel;
            self.queues[brdf] = Some(queue);
            return true;
        }
        let mut queues = own.into_iter().chain(0..Features::MOST_NEUBRDF_QUEUES);
        let shared = queues.find(|queue| holds(&self.serving(*queue)));
        self.queues[brdf] = shared.or(own);
        shared.is_some()
    }
}
