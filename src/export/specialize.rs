//! Specialization constants of a SPIR-V module become constants: naga knows no operations on them.
//! <https://registry.khronos.org/SPIR-V/specs/unified1/SPIRV.html>, sections 2.3 and 3.

use std::collections::HashMap;

/// An instruction on specialization constants that is not known here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("SPIR-V operation {0} on specialization constants is not known")]
pub struct Unknown(pub u32);

const WORDS_OF_HEADER: usize = 5;
const OP_TYPE_BOOL: u32 = 20;
const OP_CONSTANT_TRUE: u32 = 41;
const OP_CONSTANT_FALSE: u32 = 42;
const OP_CONSTANT: u32 = 43;
const OP_SPEC_CONSTANT_TRUE: u32 = 48;
const OP_SPEC_CONSTANT_FALSE: u32 = 49;
const OP_SPEC_CONSTANT: u32 = 50;
const OP_SPEC_CONSTANT_OP: u32 = 52;
const OP_DECORATE: u32 = 71;
const DECORATION_SPEC_ID: u32 = 1;

/// The module with the constants of these ids set, others as they were, and all that is computed from them computed. Constants are
/// bools and numbers of 32 bits.
///
/// # Errors
/// It computes with constants what `evaluate` does not know.
pub fn specialize(spirv: &[u32], values: &[(u32, u32)]) -> Result<Vec<u32>, Unknown> {
    let mut specialized = spirv[..WORDS_OF_HEADER.min(spirv.len())].to_vec();
    let mut set: HashMap<u32, u32> = HashMap::new();
    let mut known: HashMap<u32, u32> = HashMap::new();
    let mut bool_type = None;
    let mut rest = &spirv[specialized.len()..];
    while let Some(first) = rest.first() {
        let length = ((first >> 16) as usize).clamp(1, rest.len());
        let (instruction, others) = rest.split_at(length);
        rest = others;
        let opcode = first & 0xffff;
        let constant = match (opcode, &instruction[1..]) {
            (OP_TYPE_BOOL, [id]) => {
                bool_type = Some(*id);
                None
            }
            (OP_DECORATE, [id, DECORATION_SPEC_ID, number]) => {
                set.extend(values.iter().find(|(name, _)| name == number).map(|(_, value)| (*id, *value)));
                // The decoration goes with what it decorated.
                continue;
            }
            (OP_CONSTANT_TRUE, [kind, id]) => Some((*kind, *id, 1)),
            (OP_CONSTANT_FALSE, [kind, id]) => Some((*kind, *id, 0)),
            (OP_CONSTANT, [kind, id, value]) => Some((*kind, *id, *value)),
            (OP_SPEC_CONSTANT_TRUE, [kind, id]) => Some((*kind, *id, *set.get(id).unwrap_or(&1))),
            (OP_SPEC_CONSTANT_FALSE, [kind, id]) => Some((*kind, *id, *set.get(id).unwrap_or(&0))),
            (OP_SPEC_CONSTANT, [kind, id, value]) => Some((*kind, *id, *set.get(id).unwrap_or(value))),
            (OP_SPEC_CONSTANT_OP, [kind, id, operation, operands @ ..]) => {
                let operands: Vec<u32> = operands.iter().map_while(|operand| known.get(operand).copied()).collect();
                Some((*kind, *id, evaluate(*operation, &operands).ok_or(Unknown(*operation))?))
            }
            _ => None,
        };
        match constant {
            Some((kind, id, value)) if Some(kind) == bool_type => {
                known.insert(id, value);
                let opcode = if value != 0 { OP_CONSTANT_TRUE } else { OP_CONSTANT_FALSE };
                specialized.extend([3 << 16 | opcode, kind, id]);
            }
            Some((kind, id, value)) => {
                known.insert(id, value);
                specialized.extend([4 << 16 | OP_CONSTANT, kind, id, value]);
            }
            None => specialized.extend_from_slice(instruction),
        }
    }
    Ok(specialized)
}

/// What an instruction computes from unsigned integers and bools; `None` if it is not one of these.
fn evaluate(operation: u32, operands: &[u32]) -> Option<u32> {
    Some(match (operation, operands) {
        (128, [a, b]) => a.wrapping_add(*b),      // OpIAdd
        (130, [a, b]) => a.wrapping_sub(*b),      // OpISub
        (132, [a, b]) => a.wrapping_mul(*b),      // OpIMul
        (134, [a, b]) => a.checked_div(*b)?,      // OpUDiv
        (137, [a, b]) => a.checked_rem(*b)?,      // OpUMod
        (164 | 170, [a, b]) => u32::from(a == b), // OpLogicalEqual, OpIEqual
        (165 | 171, [a, b]) => u32::from(a != b), // OpLogicalNotEqual, OpINotEqual
        (166, [a, b]) => a | b,                   // OpLogicalOr
        (167, [a, b]) => a & b,                   // OpLogicalAnd
        (168, [a]) => u32::from(*a == 0),         // OpLogicalNot
        (169, [condition, a, b]) => {
            if *condition != 0 {
                *a
            } else {
                *b
            }
        } // OpSelect
        (172, [a, b]) => u32::from(a > b),        // OpUGreaterThan
        (174, [a, b]) => u32::from(a >= b),       // OpUGreaterThanEqual
        (176, [a, b]) => u32::from(a < b),        // OpULessThan
        (178, [a, b]) => u32::from(a <= b),       // OpULessThanEqual
        (194, [a, b]) => a.checked_shr(*b)?,      // OpShiftRightLogical
        (196, [a, b]) => a.checked_shl(*b)?,      // OpShiftLeftLogical
        (197, [a, b]) => a | b,                   // OpBitwiseOr
        (199, [a, b]) => a & b,                   // OpBitwiseAnd
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operations_become_constants() {
        // bool %1, uint %2, %3 = spec id 7, default 5; %4 = %3 * %3; %5 = %4 > %3; %6 = spec id 8, default false.
        let module = [
            0x0723_0203,
            0x0001_0300,
            0,
            7,
            0,
            4 << 16 | OP_DECORATE,
            3,
            DECORATION_SPEC_ID,
            7,
            4 << 16 | OP_DECORATE,
            6,
            DECORATION_SPEC_ID,
            8,
            2 << 16 | OP_TYPE_BOOL,
            1,
            4 << 16 | OP_SPEC_CONSTANT,
            2,
            3,
            5,
            6 << 16 | OP_SPEC_CONSTANT_OP,
            2,
            4,
            132,
            3,
            3,
            6 << 16 | OP_SPEC_CONSTANT_OP,
            1,
            5,
            172,
            4,
            3,
            3 << 16 | OP_SPEC_CONSTANT_FALSE,
            1,
            6,
        ];
        let tail = |values| specialize(&module, values).unwrap()[7..].to_vec();
        let expected = |three: u32, five: u32, six: u32| {
            vec![
                4 << 16 | OP_CONSTANT,
                2,
                3,
                three,
                4 << 16 | OP_CONSTANT,
                2,
                4,
                three * three,
                3 << 16 | five,
                1,
                5,
                3 << 16 | six,
                1,
                6,
            ]
        };
        assert_eq!(tail(&[]), expected(5, OP_CONSTANT_TRUE, OP_CONSTANT_FALSE));
        assert_eq!(tail(&[(7, 1), (8, 1), (9, 1)]), expected(1, OP_CONSTANT_FALSE, OP_CONSTANT_TRUE));
        let mut unknown = module;
        unknown[22] = 9999;
        assert_eq!(specialize(&unknown, &[]), Err(Unknown(9999)));
        // Anything ends.
        for length in 0..module.len() {
            drop(specialize(&module[..length], &[]));
        }
    }
}
