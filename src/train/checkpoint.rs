//! A training's state on disk, bit for bit.
//!
//! A file of [`write_sealed`], whose content is the numbers of [`super::trainer::Trainer`] in its order, of one member of a group after the other. The
//! pairs are not stored: they are drawn again, and have to be the same.

use std::path::Path;

use bytemuck::{Pod, cast_slice, cast_slice_mut};
use serde::{Deserialize, Serialize};

use super::plan::Plan;
use super::{Error, Group, Session};
use crate::image::{open_sealed, write_sealed};

const MAGIC: &[u8; 8] = b"NBRDFTR3";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    version: String,
    /// Of a group: whether its network is common.
    shares_network: Option<bool>,
    sessions: Vec<SessionHeader>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SessionHeader {
    plan: Plan,
    /// What tells the pairs from others.
    pairs: String,
    step: u32,
    adam_step: u32,
    /// Bits of the averaged loss, which may be NaN.
    loss: u64,
    seconds: f64,
    widths: Vec<usize>,
    /// Codes of each table that has been given codes on the way.
    codes: Vec<Option<usize>>,
}

/// Steps done by the training whose state a file holds.
pub fn saved_steps(path: &Path) -> Result<u32, Error> {
    let bytes = read(path)?;
    let (header, _) = open_sealed::<Header>(&bytes, MAGIC)
        .map_err(|reason| Error::CheckpointFormat { path: path.to_owned(), reason })?;
    Ok(header.sessions.iter().map(|session| session.step).max().unwrap_or(0))
}

impl Session {
    /// Writes the state, whole or not at all.
    pub fn save(&mut self, path: &Path) -> Result<(), Error> {
        save(path, std::slice::from_mut(self), None)
    }

    /// Goes on from what [`Session::save`] wrote for the same plan and ground truth. On an error the session is not to be used.
    pub fn restore(&mut self, path: &Path) -> Result<(), Error> {
        restore(path, std::slice::from_mut(self), None)
    }

    fn header(&self) -> SessionHeader {
        let trainer = &self.trainer;
        SessionHeader {
            plan: self.plan.clone(),
            pairs: self.pairs_hash.clone(),
            step: trainer.step,
            adam_step: trainer.adam_step,
            loss: self.loss.to_bits(),
            seconds: self.seconds,
            widths: trainer.network.widths(),
            codes: trainer.tables.iter().map(|table| table.nearest_codes()).collect(),
        }
    }

    /// Takes over a state. Returns the rest of the bytes.
    fn read<'a>(&mut self, header: &SessionHeader, mut rest: &'a [u8]) -> Result<&'a [u8], &'static str> {
        self.shape(&header.widths, &header.codes).ok_or("its sizes are not those of its plan")?;
        self.trainer.step = header.step;
        self.trainer.adam_step = header.adam_step;
        self.loss = f64::from_bits(header.loss);
        self.seconds = header.seconds;
        let (floats, indices) = self.trainer.state();
        for part in floats {
            rest = take(rest, part).ok_or("it is cut short")?;
        }
        for part in indices {
            rest = take(rest, part).ok_or("it is cut short")?;
        }
        self.trainer.look_up().then_some(rest).ok_or("its numbers are not those of its plan")
    }
}

impl Group {
    /// Writes the state of all members, whole or not at all.
    pub fn save(&mut self, path: &Path) -> Result<(), Error> {
        save(path, &mut self.members, Some(self.shares_network))
    }

    /// Goes on from what [`Group::save`] wrote for the same plans and ground truths. On an error the group is not to be used.
    pub fn restore(&mut self, path: &Path) -> Result<(), Error> {
        restore(path, &mut self.members, Some(self.shares_network))
    }
}

fn save(path: &Path, sessions: &mut [Session], shares_network: Option<bool>) -> Result<(), Error> {
    let headers = sessions.iter().map(Session::header).collect();
    let header = Header { version: env!("CARGO_PKG_VERSION").to_owned(), shares_network, sessions: headers };
    let mut parts: Vec<&[u8]> = Vec::new();
    for session in sessions {
        let (floats, indices) = session.trainer.state();
        parts.extend(floats.into_iter().map(|part| cast_slice::<_, u8>(part)));
        parts.extend(indices.into_iter().map(|part| cast_slice::<_, u8>(part)));
    }
    Ok(write_sealed(path, MAGIC, &header, &parts)?)
}

fn restore(path: &Path, sessions: &mut [Session], shares_network: Option<bool>) -> Result<(), Error> {
    let bytes = read(path)?;
    let format = |reason| Error::CheckpointFormat { path: path.to_owned(), reason };
    let (header, mut rest) = open_sealed::<Header>(&bytes, MAGIC).map_err(format)?;
    let all = |is_equal: fn(&SessionHeader, &Session) -> bool| {
        header.sessions.len() == sessions.len() && header.sessions.iter().zip(&*sessions).all(|(a, b)| is_equal(a, b))
    };
    for (what, is_equal) in [
        ("the version", header.version == env!("CARGO_PKG_VERSION")),
        ("what is shared", header.shares_network == shares_network),
        ("the plan (model, recipe, quality, seed or a size)", all(|saved, session| saved.plan == session.plan)),
        ("the input, or the program that saved it,", all(|saved, session| saved.pairs == session.pairs_hash)),
    ] {
        if !is_equal {
            return Err(Error::CheckpointMismatch { path: path.to_owned(), what });
        }
    }
    for (saved, session) in header.sessions.iter().zip(sessions) {
        rest = session.read(saved, rest).map_err(format)?;
    }
    if rest.is_empty() { Ok(()) } else { Err(format("its numbers are not those of its plan")) }
}

fn read(path: &Path) -> Result<Vec<u8>, Error> {
    std::fs::read(path).map_err(|source| Error::CheckpointFile { path: path.to_owned(), source })
}

fn take<'a, T: Pod>(bytes: &'a [u8], to: &mut [T]) -> Option<&'a [u8]> {
    let (taken, rest) = bytes.split_at_checked(size_of_val(to))?;
    cast_slice_mut(to).copy_from_slice(taken);
    Some(rest)
}
