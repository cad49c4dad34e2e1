//! What all calls have in common: results, messages, structs that grow, and panics that go no further.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use crate::{gpu, plugin, render, scene};

/// What became of a call. `neubrdf_last_error` has the words for all but NEUBRDF_RESULT_OK.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeubrdfResult {
    /// It did what it says.
    Ok = 0,
    /// A pointer is null, or a number is none that the call takes.
    InvalidArgument = 1,
    /// A scene, or a file of one, is not as it must be.
    Scene = 2,
    /// Settings are out of range, or the device lacks what they need.
    Settings = 3,
    /// The device lacks what we need of every device.
    UnfitDevice = 4,
    /// No memory is left. All objects are as before the call.
    OutOfMemory = 5,
    /// The device is lost.
    DeviceLost = 6,
    /// Another Vulkan call failed.
    Vulkan = 7,
    /// The change needs kernels that were not built: make a new renderer, or reserve for it beforehand.
    NewRenderer = 8,
    /// As many recordings as the renderer was made for are not known to be done.
    FramesInFlight = 9,
    /// A mistake of this library: please report it. Destroy the objects that the call was given.
    Panic = 10,
}

/// Why a call did not do what it says.
pub(super) struct Failure {
    result: NeubrdfResult,
    message: String,
}

impl Failure {
    pub fn argument(message: impl Into<String>) -> Failure {
        Failure { result: NeubrdfResult::InvalidArgument, message: message.into() }
    }

    pub fn scene(message: impl ToString) -> Failure {
        Failure { result: NeubrdfResult::Scene, message: message.to_string() }
    }
}

impl From<gpu::Error> for Failure {
    fn from(error: gpu::Error) -> Failure {
        let result = match error {
            gpu::Error::OutOfMemory { .. } | gpu::Error::BufferTooLarge { .. } => NeubrdfResult::OutOfMemory,
            gpu::Error::DeviceLost { .. } => NeubrdfResult::DeviceLost,
            gpu::Error::Unfit { .. } => NeubrdfResult::UnfitDevice,
            gpu::Error::HostAllocator { .. } => NeubrdfResult::InvalidArgument,
            _ => NeubrdfResult::Vulkan,
        };
        Failure { result, message: error.to_string() }
    }
}

impl From<scene::Error> for Failure {
    fn from(error: scene::Error) -> Failure {
        Failure::scene(error)
    }
}

impl From<scene::Flaw> for Failure {
    fn from(error: scene::Flaw) -> Failure {
        Failure::scene(error)
    }
}

impl From<render::Error> for Failure {
    fn from(error: render::Error) -> Failure {
        Failure::from(plugin::Error::from(error))
    }
}

impl From<plugin::Error> for Failure {
    fn from(error: plugin::Error) -> Failure {
        let result = match error {
            plugin::Error::Gpu(error) => return error.into(),
            plugin::Error::Scene(_) | plugin::Error::HostMesh { .. } => NeubrdfResult::Scene,
            plugin::Error::NewRenderer { .. } => NeubrdfResult::NewRenderer,
            plugin::Error::FramesInFlight { .. } => NeubrdfResult::FramesInFlight,
            plugin::Error::Render(_) => NeubrdfResult::Settings,
            _ => NeubrdfResult::InvalidArgument,
        };
        Failure { result, message: error.to_string() }
    }
}

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// The words of the last call on this thread that did not return NEUBRDF_RESULT_OK: UTF-8, valid until the next such call. Empty
/// if there was none; never null.
#[unsafe(no_mangle)]
pub extern "C" fn neubrdf_last_error() -> *const c_char {
    LAST_ERROR.with_borrow(|message| message.as_ptr())
}

/// The library's version as 10⁶ major + 10³ minor + patch.
#[unsafe(no_mangle)]
pub extern "C" fn neubrdf_version() -> u32 {
    let part = |text: &str| text.parse::<u32>().unwrap_or(0);
    part(env!("CARGO_PKG_VERSION_MAJOR")) * 1_000_000
        + part(env!("CARGO_PKG_VERSION_MINOR")) * 1000
        + part(env!("CARGO_PKG_VERSION_PATCH"))
}

/// Runs a call's body. What it returns, a panic too, becomes a result and a message.
pub(super) fn call(body: impl FnOnce() -> Result<(), Failure>) -> NeubrdfResult {
    let Failure { result, message } = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => return NeubrdfResult::Ok,
        Ok(Err(failure)) => failure,
        Err(panic) => Failure { result: NeubrdfResult::Panic, message: words(panic.as_ref()) },
    };
    // A message with a zero in it ends there.
    let text = CString::new(message.split('\0').next().unwrap_or_default()).unwrap_or_default();
    LAST_ERROR.set(text);
    result
}

fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or(panic.downcast_ref::<String>().map(String::as_str));
    format!("a mistake of this library, please report it: {}", text.unwrap_or("without words"))
}

/// A C struct whose first member is its size in bytes, a `u32`. All bits zero is a value of it.
///
/// # Safety
/// So it is, and nothing in it has invalid values: numbers, pointers, and structs of these.
pub(super) unsafe trait Sized32: Copy {
    /// Its name in C.
    const NAME: &'static str;
    /// Its size in the first version that had it.
    const FIRST: usize;
}

/// Names structs of numbers, and of handles and pointers for which null is a value, with their sizes in the first version that had
/// them, which stay when members are added, and with all their members, which leave no hole: what is in a hole nobody sets to 0, so that no
/// later version could put a member there.
macro_rules! sized_structs {
    ($($name:ident: $first:literal { $($member:ident),+ $(,)? })+) => {$(
        // SAFETY: so they are, as who calls this macro says.
        unsafe impl super::call::Sized32 for $name {
            const NAME: &'static str = stringify!($name);
            // Where pointers are shorter no version has been released.
            const FIRST: usize = if cfg!(target_pointer_width = "64") { $first } else { size_of::<$name>() };
        }
        const _: () = {
            assert!(<$name as super::call::Sized32>::FIRST <= size_of::<$name>());
            const fn members(of: &$name) -> usize {
                let $name { $($member),+ } = of;
                0 $(+ size_of_val($member))+
            }
            // SAFETY: all bits zero is a value.
            let bytes = members(&unsafe { std::mem::zeroed() });
            assert!(cfg!(not(target_pointer_width = "64")) || bytes == size_of::<$name>(), "a struct with a hole");
        };
    )+};
}
pub(super) use sized_structs;

/// What a caller's struct holds; what it does not have is 0. What it has and this library does not know must be 0: a program that is newer
/// than the library asks for something there.
///
/// # Safety
/// The pointer is null or points to as many readable bytes as its size member says.
pub(super) unsafe fn read<T: Sized32>(pointer: *const T) -> Result<T, Failure> {
    // SAFETY: a size is there at least, as the caller says.
    let size = unsafe { sized(pointer)? };
    // SAFETY: all bits zero is a value.
    let mut value: T = unsafe { std::mem::zeroed() };
    let bytes = size.min(size_of::<T>());
    // SAFETY: the caller says that they are there.
    let unknown = unsafe { std::slice::from_raw_parts(pointer.cast::<u8>().add(bytes), size - bytes) };
    if unknown.iter().any(|byte| *byte != 0) {
        return Err(Failure::argument(format!(
            "{} says something in members that this library, version {}, does not have: set them to 0, or take a newer library",
            T::NAME,
            env!("CARGO_PKG_VERSION")
        )));
    }
    // SAFETY: both have that many bytes, and any bytes are a value.
    unsafe { std::ptr::copy_nonoverlapping(pointer.cast::<u8>(), (&raw mut value).cast::<u8>(), bytes) };
    Ok(value)
}

/// Fills a caller's struct, as far as it reaches; its size stays.
///
/// # Safety
/// The pointer is null or points to as many writable bytes as its size member says.
pub(super) unsafe fn write<T: Sized32>(pointer: *mut T, value: T) -> Result<(), Failure> {
    // SAFETY: a size is there at least, as the caller says.
    let size = unsafe { sized(pointer)? };
    let bytes = size.min(size_of::<T>());
    // SAFETY: both have that many bytes; the size at the beginning is stepped over.
    unsafe {
        let (from, to) = ((&raw const value).cast::<u8>(), pointer.cast::<u8>());
        std::ptr::copy_nonoverlapping(from.add(4), to.add(4), bytes - 4);
    }
    Ok(())
}

/// Bytes of a struct that is still plausible.
const LARGEST: usize = 1 << 16;

/// # Safety
/// The pointer is null or points to a `u32`.
unsafe fn sized<T: Sized32>(pointer: *const T) -> Result<usize, Failure> {
    if pointer.is_null() {
        return Err(Failure::argument(format!("a pointer to {} is null", T::NAME)));
    }
    // SAFETY: as the caller says.
    let size = unsafe { pointer.cast::<u32>().read_unaligned() } as usize;
    match (T::FIRST..=LARGEST).contains(&size) {
        true => Ok(size),
        false => Err(Failure::argument(format!("{}.size is {size}: set it to sizeof({})", T::NAME, T::NAME))),
    }
}

/// What a pointer points to.
///
/// # Safety
/// The pointer is null or points to a T that nobody else uses meanwhile.
pub(super) unsafe fn object<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T, Failure> {
    // SAFETY: as the caller says.
    unsafe { pointer.as_mut() }.ok_or_else(|| Failure::argument(format!("{name} is null")))
}

/// The same, only to look at.
///
/// # Safety
/// The pointer is null or points to a T that nobody changes meanwhile.
pub(super) unsafe fn shared<'a, T>(pointer: *const T, name: &str) -> Result<&'a T, Failure> {
    // SAFETY: as the caller says.
    unsafe { pointer.as_ref() }.ok_or_else(|| Failure::argument(format!("{name} is null")))
}

/// The elements of an array; none of one of length 0.
///
/// # Safety
/// The pointer is null or points to that many elements, which nobody changes meanwhile.
pub(super) unsafe fn array<'a, T>(pointer: *const T, count: usize, name: &str) -> Result<&'a [T], Failure> {
    if count == 0 {
        return Ok(&[]);
    }
    let fits = count.checked_mul(size_of::<T>()).is_some_and(|bytes| bytes <= isize::MAX as usize);
    if pointer.is_null() || !pointer.is_aligned() || !fits {
        return Err(Failure::argument(format!("{name}: {count} elements at {pointer:?}")));
    }
    // SAFETY: as the caller says.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// A path in UTF-8.
///
/// # Safety
/// The pointer is null or points to a C string.
pub(super) unsafe fn path(pointer: *const c_char) -> Result<PathBuf, Failure> {
    // SAFETY: as the caller says.
    let text = unsafe { text(pointer, "a path")? };
    text.map(|text| Path::new(text).to_owned()).ok_or_else(|| Failure::argument("a path is null"))
}

/// A text in UTF-8; `None` for null.
///
/// # Safety
/// The pointer is null or points to a C string, which nobody changes meanwhile.
pub(super) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<Option<&'a str>, Failure> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: as the caller says.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map(Some).map_err(|_| Failure::argument(format!("{name} is not UTF-8")))
}

/// Puts a value where a pointer that may be null points.
///
/// # Safety
/// The pointer is null or points to a writable T.
pub(super) unsafe fn put<T>(pointer: *mut T, value: T) {
    if !pointer.is_null() {
        // SAFETY: as the caller says.
        unsafe { pointer.write(value) };
    }
}

/// Hands a new object to the caller.
///
/// # Safety
/// The pointer is null or points to room for a pointer.
pub(super) unsafe fn hand_over<T>(room: *mut *mut T, object: T) -> Result<(), Failure> {
    if room.is_null() {
        return Err(Failure::argument("the pointer to the new object is null"));
    }
    // SAFETY: as the caller says.
    unsafe { room.write(Box::into_raw(Box::new(object))) };
    Ok(())
}

/// Ends an object that [`hand_over`] made; null is none.
///
/// # Safety
/// The pointer is null or of such an object, not ended yet, that nobody uses.
pub(super) unsafe fn end<T>(object: *mut T) {
    if !object.is_null() {
        // What its end may panic with is nobody's business.
        let _ = call(|| {
            // SAFETY: as the caller says.
            drop(unsafe { Box::from_raw(object) });
            Ok(())
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_goes_no_further_and_has_words() {
        assert_eq!(call(|| panic!("an invariant")) as i32, NeubrdfResult::Panic as i32);
        // SAFETY: the words are a C string, and this thread makes no other call meanwhile.
        let words = unsafe { CStr::from_ptr(neubrdf_last_error()) }.to_str().unwrap();
        assert!(words.contains("an invariant"), "{words}");
    }

    /// A struct that grew by a member since the first version.
    #[derive(Clone, Copy)]
    #[repr(C)]
    struct Grown {
        size: u32,
        old: u32,
        new: u32,
    }

    // SAFETY: numbers.
    unsafe impl Sized32 for Grown {
        const NAME: &'static str = "Grown";
        const FIRST: usize = 8;
    }

    #[test]
    fn structs_of_older_and_newer_programs_are_read_as_far_as_they_go() {
        let read = |size| {
            let theirs = Grown { size, old: 1, new: 2 };
            // SAFETY: there are as many bytes as the sizes below say, or none are read.
            unsafe { read(&raw const theirs) }.map(|ours| (ours.old, ours.new)).ok()
        };
        assert_eq!([7, 8, 12, u32::MAX].map(read), [None, Some((1, 0)), Some((1, 2)), None]);
        let newer = |unknown| {
            let theirs = [16, 1, 2, unknown];
            // SAFETY: there are 16 bytes.
            unsafe { super::read(theirs.as_ptr().cast::<Grown>()) }.map(|ours| (ours.old, ours.new)).ok()
        };
        assert_eq!([0, 5].map(newer), [Some((1, 2)), None]);
        let mut theirs = Grown { size: 8, old: 0, new: 0 };
        // SAFETY: as many bytes are there.
        assert!(unsafe { write(&raw mut theirs, Grown { size: 12, old: 3, new: 4 }) }.is_ok());
        assert_eq!((theirs.size, theirs.old, theirs.new), (8, 3, 0));
    }
}
