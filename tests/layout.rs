//! Host and kernels agree on every struct, binding and push constant, and what `build.rs` makes is what the sources say.

mod common;

#[allow(dead_code)] // its main() is Cargo's
#[path = "../build.rs"]
mod build_script;

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;
use std::process::Command;

use neubrdf::gpu::PUSH_CONSTANT_BYTES;
use neubrdf::gpu::layout::{Member, StructLayout};
use neubrdf::gpu::spirv;
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, ExecutionModel, Op, StorageClass, Word};

/// All structs that host and kernels share.
const SHARED: &[&[StructLayout]] = &[
    common::bsdf_structs::BSDF_TEST_STRUCTS,
    common::gpu_structs::GPU_TEST_STRUCTS,
    neubrdf::render::GATHER_STRUCTS,
    neubrdf::render::INSTANCE_STRUCTS,
    neubrdf::render::MESH_STRUCTS,
    neubrdf::render::MATERIAL_STRUCTS,
    neubrdf::render::NEUBRDF_STRUCTS,
    neubrdf::render::BRDF_STRUCTS,
    neubrdf::render::bvh::BVH_STRUCTS,
    neubrdf::render::RAY_STRUCTS,
    neubrdf::render::WAVEFRONT_STRUCTS,
    neubrdf::plugin::DEVELOP_STRUCTS,
];

#[test]
fn every_struct_of_every_kernel_is_laid_out_as_its_rust_counterpart() {
    let mut shared = BTreeMap::new();
    for layout in SHARED.iter().copied().flatten() {
        if let Some(other) = shared.insert(layout.name, layout) {
            assert_eq!(layout, other, "two structs of one name");
        }
    }
    let mut wrong = Vec::new();
    let mut seen = BTreeSet::new();
    for name in spirv::names() {
        let reflected = Reflection::new(spirv::load(name).unwrap().spirv);
        for id in reflected.shared_types() {
            reflected.check(id, &shared, &mut seen, &mut |problem| wrong.push(format!("{name}: {problem}")));
        }
    }
    assert!(wrong.is_empty(), "{} mismatches:\n{}", wrong.len(), wrong.join("\n"));
    let unused: Vec<_> = shared.keys().filter(|name| !seen.contains(**name)).collect();
    assert!(unused.is_empty(), "no kernel has {unused:?}");
}

#[test]
fn structs_of_exported_modules_are_laid_out_as_their_rust_counterparts() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let shared: BTreeMap<_, _> = neubrdf::export::EXPORT_STRUCTS.iter().map(|layout| (layout.name, layout)).collect();
    let mut seen = BTreeSet::new();
    for module in build_script::exported(root).unwrap() {
        let reflected = Reflection::new(&std::fs::read(root.join(format!("spirv/{module}.spv"))).unwrap());
        // Structs of buffers, which have offsets.
        let in_buffers = reflected.names.iter().filter(|(id, _)| reflected.offsets.contains_key(&(**id, 0)));
        for (id, name) in in_buffers.filter(|(_, name)| shared.contains_key(name.as_str())) {
            reflected.check(*id, &shared, &mut seen, &mut |problem| panic!("{module}, {name}: {problem}"));
        }
    }
    assert!(seen.iter().eq(shared.keys()), "found {seen:?} of {:?}", shared.keys());
}

#[test]
fn a_struct_that_differs_is_found() {
    let right = common::gpu_structs::GPU_TEST_STRUCTS.iter().find(|s| s.name == "GpuTestFillPush").unwrap();
    let source = spirv::load("gpu_test_fill").unwrap();
    let problems = |shared: &[StructLayout]| {
        let shared = shared.iter().map(|layout| (layout.name, layout)).collect();
        let reflected = Reflection::new(source.spirv);
        let mut problems = Vec::new();
        for id in reflected.shared_types() {
            reflected.check(id, &shared, &mut BTreeSet::new(), &mut |problem| problems.push(problem));
        }
        problems.concat()
    };
    let [words, count, pad] = *right.members else { panic!("{right:?}") };
    assert_eq!(problems(&[*right]), "");
    assert!(problems(&[]).contains("no Rust counterpart"));
    assert!(problems(&[StructLayout { size: 24, ..*right }]).contains("16 bytes in GLSL, 24 in Rust"));
    let renamed = Member { name: "number", ..count };
    let moved = Member { offset: 12, ..count };
    let smaller = Member { size: 4, ..words };
    for members in [vec![words, renamed, pad], vec![words, moved, pad], vec![smaller, count, pad], vec![words, count]] {
        let wrong = StructLayout { members: members.leak(), ..*right };
        assert!(problems(&[wrong]).contains("(member, offset, size)"), "{wrong:?}");
    }
}

#[test]
fn a_kernel_has_push_constants_and_at_most_one_acceleration_structure() {
    for name in spirv::names() {
        let source = spirv::load(name).unwrap();
        let reflected = Reflection::new(source.spirv);
        let entry = &reflected.module.entry_points[0];
        assert_eq!(reflected.module.entry_points.len(), 1, "{name}");
        assert_eq!(entry.operands[0], Operand::ExecutionModel(ExecutionModel::GLCompute), "{name}");
        assert_eq!(entry.operands[2], Operand::LiteralString("main".to_string()), "{name}");

        let push: Vec<Word> = reflected.variables(StorageClass::PushConstant).collect();
        let bytes = push.first().map_or(0, |block| reflected.size(*block));
        assert!(push.len() <= 1, "{name}");
        assert_eq!(source.push_constant_bytes as usize, bytes, "{name}: push constants");
        assert!(bytes <= PUSH_CONSTANT_BYTES as usize, "{name}: {bytes} bytes of push constants");

        for class in [StorageClass::Uniform, StorageClass::StorageBuffer] {
            assert_eq!(reflected.variables(class).count(), 0, "{name}: data goes by buffer device address");
        }
        let bound: Vec<Word> = reflected.variables(StorageClass::UniformConstant).collect();
        assert!(bound.len() <= 1, "{name}");
        assert_eq!(source.uses_acceleration_structure, bound.len() == 1, "{name}");
        for id in bound {
            assert_eq!(reflected.types[&id].class.opcode, Op::TypeAccelerationStructureKHR, "{name}");
        }
        for decoration in [Decoration::DescriptorSet, Decoration::Binding] {
            assert!(reflected.decorated(decoration).all(|number| number == 0), "{name}: set 0, binding 0");
        }
    }
}

#[test]
fn every_module_is_compiled_from_the_source_as_it_stands() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let kernels = build_script::kernels(root).unwrap();
    let exported = build_script::exported(root).unwrap();
    let modules = kernels.iter().chain(&exported);
    let stale: Vec<_> = modules.filter(|module| !build_script::is_fresh(root, module).unwrap()).collect();
    assert!(stale.is_empty(), "stale in spirv/: {stale:?}; install glslangValidator, build, and commit spirv/");
    assert_eq!(spirv::names().collect::<Vec<_>>(), kernels, "spirv/ and glsl/kernels hold the same names");
}

/// What cached references are kept under.
#[test]
fn a_change_of_the_references_code_changes_its_hash() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    assert_eq!(build_script::reference_hash(root).unwrap(), env!("NEUBRDF_REFERENCE"));
    let copy = tempfile::tempdir().unwrap();
    for room in ["material", "reference", "scene/brdf"] {
        std::fs::create_dir_all(copy.path().join("src").join(room)).unwrap();
    }
    let hash_with = |text: &str| {
        std::fs::write(copy.path().join("src/scene/brdf/a.rs"), text).unwrap();
        build_script::reference_hash(copy.path()).unwrap()
    };
    assert_eq!(hash_with("1.0"), hash_with("1.0"));
    assert_ne!(hash_with("1.0"), hash_with("2.0"));
}

#[test]
fn every_module_is_valid() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let modules = root.join("spirv");
    for name in spirv::names().map(str::to_owned).chain(build_script::exported(root).unwrap()) {
        let mut validator = Command::new("spirv-val");
        validator.args(["--target-env", "vulkan1.2", "--scalar-block-layout"]).arg(modules.join(format!("{name}.spv")));
        match validator.output() {
            Ok(output) => assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr)),
            Err(error) => return common::skip(format_args!("spirv-val: {error}")),
        }
    }
}

/// A module with its types, names and decorations by id.
struct Reflection {
    module: Module,
    types: HashMap<Word, Instruction>,
    constants: HashMap<Word, u32>,
    names: HashMap<Word, String>,
    member_names: HashMap<(Word, u32), String>,
    offsets: HashMap<(Word, u32), usize>,
    strides: HashMap<Word, usize>,
}

impl Reflection {
    fn new(spirv: &[u8]) -> Reflection {
        let module = rspirv::dr::load_bytes(spirv).unwrap();
        let mut types = HashMap::new();
        let mut constants = HashMap::new();
        for instruction in &module.types_global_values {
            let Some(id) = instruction.result_id else { continue };
            if let (Op::Constant, [Operand::LiteralBit32(value)]) =
                (instruction.class.opcode, &instruction.operands[..])
            {
                constants.insert(id, *value);
            }
            types.insert(id, instruction.clone());
        }
        let mut names = HashMap::new();
        let mut member_names = HashMap::new();
        for instruction in &module.debug_names {
            match instruction.operands.as_slice() {
                [Operand::IdRef(id), Operand::LiteralString(name)] => drop(names.insert(*id, name.clone())),
                [Operand::IdRef(id), Operand::LiteralBit32(member), Operand::LiteralString(name)] => {
                    member_names.insert((*id, *member), name.clone());
                }
                _ => {}
            }
        }
        let mut offsets = HashMap::new();
        let mut strides = HashMap::new();
        for instruction in &module.annotations {
            use Decoration::{ArrayStride, Offset};
            use Operand::{Decoration as Kind, IdRef, LiteralBit32};
            match instruction.operands.as_slice() {
                [IdRef(id), LiteralBit32(member), Kind(Offset), LiteralBit32(offset)] => {
                    offsets.insert((*id, *member), *offset as usize);
                }
                [IdRef(id), Kind(ArrayStride), LiteralBit32(stride)] => drop(strides.insert(*id, *stride as usize)),
                _ => {}
            }
        }
        Reflection { module, types, constants, names, member_names, offsets, strides }
    }

    /// The types of the variables of a storage class.
    fn variables(&self, class: StorageClass) -> impl Iterator<Item = Word> {
        let variables = self.module.types_global_values.iter().filter(move |instruction| {
            instruction.class.opcode == Op::Variable && *first(instruction) == Operand::StorageClass(class)
        });
        variables.map(|variable| self.pointee(variable.result_type.unwrap()))
    }

    /// The numbers given by a decoration.
    fn decorated(&self, wanted: Decoration) -> impl Iterator<Item = u32> {
        self.module.annotations.iter().filter_map(move |instruction| match instruction.operands.as_slice() {
            [_, Operand::Decoration(found), Operand::LiteralBit32(number)] if *found == wanted => Some(*number),
            _ => None,
        })
    }

    /// What the host fills in or reads: push constants, and whatever a device address points to.
    fn shared_types(&self) -> Vec<Word> {
        let class = Operand::StorageClass(StorageClass::PhysicalStorageBuffer);
        let pointers = self
            .module
            .types_global_values
            .iter()
            .filter(|instruction| instruction.class.opcode == Op::TypePointer && *first(instruction) == class);
        let pointees = pointers.map(|pointer| id(&pointer.operands[1]));
        pointees.chain(self.variables(StorageClass::PushConstant)).collect()
    }

    /// Compares a type, and those that it holds, with what Rust says.
    fn check(
        &self,
        at: Word,
        shared: &BTreeMap<&str, &StructLayout>,
        seen: &mut BTreeSet<String>,
        wrong: &mut impl FnMut(String),
    ) {
        let members: Vec<Word> = match self.types[&at].class.opcode {
            Op::TypeStruct => self.types[&at].operands.iter().map(id).collect(),
            Op::TypeArray | Op::TypeRuntimeArray => {
                let element = id(first(&self.types[&at]));
                if self.strides[&at] != self.size(element) {
                    let (stride, size) = (self.strides[&at], self.size(element));
                    wrong(format!("an array of {} bytes has stride {stride}", size));
                }
                return self.check(element, shared, seen, wrong);
            }
            _ => return,
        };
        members.iter().for_each(|member| self.check(*member, shared, seen, wrong));
        if let [only] = members[..]
            && self.types[&only].class.opcode == Op::TypeRuntimeArray
        {
            return;
        }
        let name = &self.names[&at];
        seen.insert(name.clone());
        let Some(rust) = shared.get(name.as_str()) else {
            return wrong(format!("{name} has no Rust counterpart in SHARED"));
        };
        let found: Vec<_> = (0..)
            .zip(&members)
            .map(|(i, member)| (self.member_names[&(at, i)].as_str(), self.offsets[&(at, i)], self.size(*member)))
            .collect();
        let expected: Vec<_> = rust.members.iter().map(|member| (member.name, member.offset, member.size)).collect();
        if found != expected {
            wrong(format!("{name} has (member, offset, size)\n  {found:?} in GLSL,\n  {expected:?} in Rust"));
        }
        if self.size(at) != rust.size {
            wrong(format!("{name} has {} bytes in GLSL, {} in Rust", self.size(at), rust.size));
        }
    }

    /// Bytes of a type laid out in memory.
    fn size(&self, at: Word) -> usize {
        let kind = &self.types[&at];
        let count = |operand: &Operand| match operand {
            Operand::LiteralBit32(count) => *count as usize,
            other => panic!("{other:?} is no count"),
        };
        match kind.class.opcode {
            Op::TypeInt | Op::TypeFloat => count(first(kind)) / 8,
            Op::TypeVector | Op::TypeMatrix => self.size(id(first(kind))) * count(&kind.operands[1]),
            Op::TypeArray => self.strides[&at] * self.constants[&id(&kind.operands[1])] as usize,
            Op::TypeRuntimeArray => 0,
            Op::TypePointer => 8,
            Op::TypeStruct => (0..)
                .zip(&kind.operands)
                .map(|(i, member)| self.offsets[&(at, i)] + self.size(id(member)))
                .max()
                .unwrap_or(0),
            other => panic!("{other:?} has no size"),
        }
    }

    fn pointee(&self, pointer: Word) -> Word {
        id(&self.types[&pointer].operands[1])
    }
}

fn first(instruction: &Instruction) -> &Operand {
    &instruction.operands[0]
}

fn id(operand: &Operand) -> Word {
    operand.id_ref_any().unwrap()
}
