//! The module as WGSL, HLSL and MSL, by naga.

use std::num::NonZeroU32;

use naga::back::{hlsl, msl, wgsl};
use naga::compact::{KeepUnused, compact};
use naga::front::spv;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{
    AddressSpace, ArraySize, Block, Constant, Expression, Function, Handle, Literal, Module, ResourceBinding,
    Statement, StorageAccess, TypeInner,
};

use super::specialize::specialize;
use super::{ENTRY_POINT, Error, Language, Place};
use crate::render::NeuBrdfShape;

/// `glsl/export/neubrdf.comp`, compiled.
const SPIRV: &[u8] = include_bytes!("../../spirv/export/neubrdf.spv");

/// The binding of the buffer that it writes.
const ANSWERS: u32 = 2;

/// `unpackHalf2x16`, which every language has.
const CAPABILITIES: Capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;

/// The text.
pub fn module(shape: &NeuBrdfShape, language: Language, place: Place) -> Result<String, Error> {
    let failed = |message: String| Error::Translation { language, message };
    let words: Vec<u32> = SPIRV.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
    let words = specialize(&words, &shape.specialization()).map_err(|error| failed(error.to_string()))?;
    let options = spv::Options { adjust_coordinate_space: false, ..spv::Options::default() };
    let parsed = spv::Frontend::new(words.into_iter(), &options).parse();
    let mut module = parsed.map_err(|error| failed(error.to_string()))?;
    name(&mut module);
    bind(&mut module, place);
    drop_dead_branches(&mut module);
    if language == Language::Msl {
        forget_lengths(&mut module);
    }
    compact(&mut module, KeepUnused::No);
    let mut validator = Validator::new(ValidationFlags::all(), CAPABILITIES);
    let info = validator.validate(&module).map_err(|error| failed(error.emit_to_string("")))?;
    write(&module, &info, language).map_err(failed)
}

/// Functions lose what glslang appends to tell overloads apart, of which there are none. None is called `main`, which is the user's.
fn name(module: &mut Module) {
    for (_, function) in module.functions.iter_mut() {
        function.name = function.name.as_deref().map(|name| match name.split('(').next() {
            None | Some("main") => format!("{ENTRY_POINT}_one"),
            Some(name) => name.to_owned(),
        });
    }
    for entry in &mut module.entry_points {
        ENTRY_POINT.clone_into(&mut entry.name);
    }
}

/// Moves the buffers, which are at group 0 from binding 0 on. All but the answers are only read.
fn bind(module: &mut Module, place: Place) {
    for (_, variable) in module.global_variables.iter_mut() {
        if let (Some(binding), AddressSpace::Storage { access }) = (&mut variable.binding, &mut variable.space) {
            if binding.binding != ANSWERS {
                *access = StorageAccess::LOAD;
            }
            binding.group += place.group;
            binding.binding += place.binding;
        }
    }
}

/// Metal's functions would be given the lengths of all buffers, which nothing asks for.
fn forget_lengths(module: &mut Module) {
    let handles: Vec<_> = module.types.iter().map(|(handle, _)| handle).collect();
    for handle in handles {
        let mut kind = module.types[handle].clone();
        if let TypeInner::Array { size: size @ ArraySize::Dynamic, .. } = &mut kind.inner {
            *size = ArraySize::Constant(NonZeroU32::MIN);
            module.types.replace(handle, kind);
        }
    }
}

/// What the shape rules out goes.
fn drop_dead_branches(module: &mut Module) {
    let constant = |handle: Handle<Constant>| match module.global_expressions[module.constants[handle].init] {
        Expression::Literal(Literal::Bool(value)) => Some(value),
        _ => None,
    };
    let functions = module.functions.iter_mut().map(|(_, function)| function);
    for function in functions.chain(module.entry_points.iter_mut().map(|entry| &mut entry.function)) {
        let value = |function: &Function, condition| match function.expressions[condition] {
            Expression::Literal(Literal::Bool(value)) => Some(value),
            Expression::Constant(handle) => constant(handle),
            _ => None,
        };
        let body = std::mem::take(&mut function.body);
        function.body = live(body, &|condition| value(function, condition));
    }
}

/// A block without the branches that are never taken, and what stands behind its end.
fn live(block: Block, value: &impl Fn(Handle<Expression>) -> Option<bool>) -> Block {
    let mut kept = Block::new();
    for (statement, span) in block.span_into_iter() {
        match statement {
            Statement::If { condition, accept, reject } => match value(condition) {
                Some(is_taken) => {
                    let taken = live(if is_taken { accept } else { reject }, value);
                    taken.span_into_iter().for_each(|(statement, span)| kept.push(statement, span));
                }
                None => {
                    let (accept, reject) = (live(accept, value), live(reject, value));
                    kept.push(Statement::If { condition, accept, reject }, span);
                }
            },
            Statement::Block(block) => kept.push(Statement::Block(live(block, value)), span),
            Statement::Loop { body, continuing, break_if } => {
                let (body, continuing) = (live(body, value), live(continuing, value));
                kept.push(Statement::Loop { body, continuing, break_if }, span);
            }
            other => kept.push(other, span),
        }
        if matches!(kept.last(), Some(Statement::Return { .. } | Statement::Break | Statement::Continue)) {
            break;
        }
    }
    kept
}

/// Data are such that no index leaves its array, and no loop is endless: nothing is checked again on the device.
fn write(module: &Module, info: &ModuleInfo, language: Language) -> Result<String, String> {
    let bindings = || module.global_variables.iter().filter_map(|(_, variable)| variable.binding);
    match language {
        Language::Wgsl => wgsl::write_string(module, info, wgsl::WriterFlags::empty()).map_err(|e| e.to_string()),
        Language::Hlsl => {
            let target = |at: ResourceBinding| hlsl::BindTarget {
                space: at.group as u8,
                register: at.binding,
                ..hlsl::BindTarget::default()
            };
            let options = hlsl::Options {
                shader_model: hlsl::ShaderModel::V6_0,
                binding_map: bindings().map(|at| (at, target(at))).collect(),
                fake_missing_bindings: false,
                restrict_indexing: false,
                force_loop_bounding: false,
                ..hlsl::Options::default()
            };
            let mut text = String::new();
            let pipeline = hlsl::PipelineOptions::default();
            let mut writer = hlsl::Writer::new(&mut text, &options, &pipeline);
            writer.write(module, info, None).map_err(|error| error.to_string())?;
            Ok(text)
        }
        Language::Msl => {
            let target = |at: ResourceBinding| msl::BindTarget {
                buffer: Some(at.binding as u8),
                mutable: true,
                ..msl::BindTarget::default()
            };
            let resources = msl::EntryPointResources {
                resources: bindings().map(|at| (at, target(at))).collect(),
                ..msl::EntryPointResources::default()
            };
            let options = msl::Options {
                lang_version: (2, 4),
                per_entry_point_map: [(ENTRY_POINT.to_owned(), resources)].into(),
                fake_missing_bindings: false,
                force_loop_bounding: false,
                ..msl::Options::default()
            };
            let (text, _) = msl::write_string(module, info, &options, &msl::PipelineOptions::default())
                .map_err(|error| error.to_string())?;
            Ok(text)
        }
        Language::Glsl => Err("GLSL is not translated".to_owned()),
    }
}
