//! Values of BSDFs, taken many at a time where that is faster: of networks, whose layers are then products of matrices.
//!
//! Each path is a future. It waits wherever it needs such a value, until all other paths wait as well; then what they asked for is evaluated
//! together, and they go on. Paths among closed forms never wait.

use std::cell::RefCell;
use std::future::{Future, poll_fn};
use std::pin::Pin;
use std::task::{Context, Poll, Waker};

use glam::DVec3;

use super::film::Sample;
use crate::material::{Bsdf, BsdfSample, Query};
use crate::scene::brdf::NeuBrdf;

/// A path on its way. It waits only for [`Values`].
pub type Path<'p> = Pin<Box<dyn Future<Output = Sample> + 'p>>;

/// What paths ask for, and what they are told.
#[derive(Default)]
pub struct Values<'s> {
    /// One a network.
    batches: RefCell<Vec<Batch<'s>>>,
}

struct Batch<'s> {
    neubrdf: &'s NeuBrdf,
    queries: Vec<Query>,
    /// Of the queries before these.
    values: Vec<DVec3>,
}

impl<'s> Values<'s> {
    /// See [`Bsdf::eval`].
    pub async fn eval(&self, bsdf: &Bsdf<'s>, wo: DVec3, wi: DVec3) -> DVec3 {
        let Some((neubrdf, query)) = bsdf.query(wo, wi) else { return bsdf.eval(wo, wi) };
        let [batch, index] = self.ask(neubrdf, query);
        others_wait().await;
        self.batches.borrow()[batch].values[index]
    }

    /// See [`Bsdf::sample`].
    pub async fn sample(&self, bsdf: &Bsdf<'s>, wo: DVec3, u: [f64; 3]) -> Option<BsdfSample> {
        let Bsdf::LobeSampled(sampled) = bsdf else { return bsdf.sample(wo, u) };
        let picked = sampled.pick(wo, u)?;
        Some(BsdfSample { weight: picked.weight * self.eval(bsdf, wo, picked.wi).await, ..picked })
    }

    /// What paths come to, in their order.
    pub fn all<'p>(&self, paths: impl Iterator<Item = Path<'p>>) -> Vec<Sample> {
        let mut context = Context::from_waker(Waker::noop());
        let mut samples = Vec::new();
        let mut waiting = Vec::new();
        for (index, mut path) in paths.enumerate() {
            match path.as_mut().poll(&mut context) {
                Poll::Ready(sample) => samples.push(sample),
                Poll::Pending => {
                    samples.push(Sample::default());
                    waiting.push((index, path));
                }
            }
        }
        while !waiting.is_empty() {
            self.evaluate();
            waiting.retain_mut(|(index, path)| match path.as_mut().poll(&mut context) {
                Poll::Ready(sample) => {
                    samples[*index] = sample;
                    false
                }
                Poll::Pending => true,
            });
        }
        samples
    }

    /// Notes a query; where its value will be.
    fn ask(&self, neubrdf: &'s NeuBrdf, query: Query) -> [usize; 2] {
        let mut batches = self.batches.borrow_mut();
        let known = batches.iter().position(|batch| std::ptr::eq(batch.neubrdf, neubrdf));
        let batch = known.unwrap_or_else(|| {
            batches.push(Batch { neubrdf, queries: Vec::new(), values: Vec::new() });
            batches.len() - 1
        });
        let queries = &mut batches[batch].queries;
        queries.push(query);
        [batch, queries.len() - 1]
    }

    /// Answers all queries.
    fn evaluate(&self) {
        for batch in self.batches.borrow_mut().iter_mut() {
            batch.values = batch.neubrdf.eval_many(&batch.queries);
            batch.queries.clear();
        }
    }
}

/// Ready when it is polled again.
async fn others_wait() {
    let mut is_over = false;
    poll_fn(|_| if std::mem::replace(&mut is_over, true) { Poll::Ready(()) } else { Poll::Pending }).await;
}
