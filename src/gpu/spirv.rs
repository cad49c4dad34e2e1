//! The SPIR-V modules in `spirv/`, built into the library, and what of them a pipeline must know.

use std::collections::HashMap;

use super::kernel::KernelSource;

/// `(name, SPIR-V)`, sorted by name; build.rs writes it.
static MODULES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/spirv_table.rs"));

/// The names of all modules, sorted: `NAME` for `glsl/kernels/NAME.comp`.
pub fn names() -> impl Iterator<Item = &'static str> {
    MODULES.iter().map(|(name, _)| *name)
}

/// The kernel compiled from `glsl/kernels/NAME.comp`, or none of that name.
pub fn load(name: &str) -> Option<KernelSource> {
    let index = MODULES.binary_search_by_key(&name, |(name, _)| name).ok()?;
    let (name, spirv) = MODULES[index];
    Some(reflect(name, spirv))
}

/// Describes a module of one compute kernel, with entry point `main`. What is no SPIR-V comes back with zeros, and will
/// be refused by [`super::Kernel::new`].
pub fn reflect(name: &'static str, spirv: &'static [u8]) -> KernelSource {
    let module = Module::parse(spirv);
    KernelSource {
        name,
        spirv,
        uses_acceleration_structure: module.uses_acceleration_structure,
        push_constant_bytes: module.push_constant.map_or(0, |id| module.size(id)),
        local_size: module.local_size,
        local_size_is_open: module.local_size_is_open,
    }
}

/// A type, as far as its size goes. <https://registry.khronos.org/SPIR-V/specs/unified1/SPIRV.html>, section 3.
enum Type {
    /// Bytes of a number.
    Scalar(u32),
    /// Component type and count: a vector, or a matrix of columns.
    Vector(u32, u32),
    /// Element type and the id of the constant length.
    Array(u32, u32),
    Struct(Vec<u32>),
    /// In push constants a pointer is a buffer device address.
    Pointer(u32),
}

#[derive(Default)]
struct Module {
    types: HashMap<u32, Type>,
    constants: HashMap<u32, u32>,
    offsets: HashMap<(u32, u32), u32>,
    strides: HashMap<u32, u32>,
    push_constant: Option<u32>,
    uses_acceleration_structure: bool,
    local_size: [u32; 3],
    local_size_is_open: bool,
}

impl Module {
    fn parse(spirv: &[u8]) -> Module {
        let words: Vec<u32> = spirv.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let mut module = Module::default();
        let mut rest = words.get(5..).unwrap_or(&[]);
        while let Some(first) = rest.first() {
            let (opcode, count) = (first & 0xffff, (first >> 16) as usize);
            let Some(instruction) = rest.get(1..count.max(1)) else { break };
            module.read(opcode, instruction);
            rest = &rest[count.max(1)..];
        }
        module
    }

    fn read(&mut self, opcode: u32, operands: &[u32]) {
        const LOCAL_SIZE: u32 = 17;
        const DECORATION_BUILT_IN: u32 = 11;
        const BUILT_IN_WORKGROUP_SIZE: u32 = 25;
        const DECORATION_ARRAY_STRIDE: u32 = 6;
        const DECORATION_OFFSET: u32 = 35;
        const STORAGE_PUSH_CONSTANT: u32 = 9;
        match (opcode, operands) {
            (16, [_, LOCAL_SIZE, x, y, z]) => self.local_size = [*x, *y, *z],
            (71, [_, DECORATION_BUILT_IN, BUILT_IN_WORKGROUP_SIZE]) => self.local_size_is_open = true,
            (71, [id, DECORATION_ARRAY_STRIDE, stride]) => drop(self.strides.insert(*id, *stride)),
            (72, [id, member, DECORATION_OFFSET, offset]) => drop(self.offsets.insert((*id, *member), *offset)),
            (21 | 22, [id, bits, ..]) => drop(self.types.insert(*id, Type::Scalar(bits / 8))),
            (23 | 24, [id, component, count]) => drop(self.types.insert(*id, Type::Vector(*component, *count))),
            (28, [id, element, length]) => drop(self.types.insert(*id, Type::Array(*element, *length))),
            (30, [id, members @ ..]) => drop(self.types.insert(*id, Type::Struct(members.to_vec()))),
            (32, [id, _, target]) => drop(self.types.insert(*id, Type::Pointer(*target))),
            (43, [_, id, value, ..]) => drop(self.constants.insert(*id, *value)),
            (59, [pointer, _, STORAGE_PUSH_CONSTANT, ..]) => {
                if let Some(Type::Pointer(block)) = self.types.get(pointer) {
                    self.push_constant = Some(*block);
                }
            }
            (5341, _) => self.uses_acceleration_structure = true, // OpTypeAccelerationStructureKHR
            _ => {}
        }
    }

    /// Bytes of a type laid out in memory, without padding at its end. Ids are defined before use, so it ends.
    fn size(&self, id: u32) -> u32 {
        match self.types.get(&id) {
            Some(Type::Scalar(bytes)) => *bytes,
            Some(Type::Vector(component, count)) => self.size(*component).saturating_mul(*count),
            Some(Type::Array(element, length)) => {
                let length = self.constants.get(length).copied().unwrap_or(0);
                self.strides.get(&id).copied().unwrap_or_else(|| self.size(*element)).saturating_mul(length)
            }
            Some(Type::Struct(members)) => (0..)
                .zip(members)
                .map(|(i, member)| self.offsets.get(&(id, i)).copied().unwrap_or(0).saturating_add(self.size(*member)))
                .max()
                .unwrap_or(0),
            Some(Type::Pointer(_)) => 8,
            None => 0,
        }
    }
}
