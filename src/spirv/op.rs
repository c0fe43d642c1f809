//! Opcodes of SPIR-V by their names in its specification, those that something here asks for.
pub const UNDEF: u16 = 1;
pub const NAME: u16 = 5;
/// The first and the last of those that declare types.
pub const TYPE_VOID: u16 = 19;
pub const TYPE_FUNCTION: u16 = 33;
pub const TYPE_BOOL: u16 = 20;
pub const TYPE_INT: u16 = 21;
pub const CONSTANT_TRUE: u16 = 41;
pub const CONSTANT_FALSE: u16 = 42;
pub const CONSTANT: u16 = 43;
pub const SPEC_CONSTANT_TRUE: u16 = 48;
pub const SPEC_CONSTANT_FALSE: u16 = 49;
pub const SPEC_CONSTANT: u16 = 50;
pub const SPEC_CONSTANT_OP: u16 = 52;
pub const FUNCTION: u16 = 54;
pub const DECORATE: u16 = 71;
/// The first and the last of those that compute with whole numbers.
pub const I_ADD: u16 = 128;
pub const S_MOD: u16 = 139;
/// The first and the last of those that choose and compare.
pub const LOGICAL_EQUAL: u16 = 164;
pub const S_LESS_THAN_EQUAL: u16 = 179;
pub const LOGICAL_OR: u16 = 166;
pub const LOGICAL_AND: u16 = 167;
pub const SELECT: u16 = 169;
pub const PHI: u16 = 245;
pub const LOOP_MERGE: u16 = 246;
pub const SELECTION_MERGE: u16 = 247;
pub const LABEL: u16 = 248;
pub const BRANCH: u16 = 249;
pub const BRANCH_CONDITIONAL: u16 = 250;
pub const SWITCH: u16 = 251;
pub const UNREACHABLE: u16 = 255;
