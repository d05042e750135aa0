"""Names of the Vulkan devices of this machine, as the Vulkan loader lists them.

A broken driver may crash the interpreter, so this is called in a child process only.
"""

import ctypes
import os

_SOFTWARE = 4  # VK_PHYSICAL_DEVICE_TYPE_CPU
_DISCRETE = 2
_NAME_OFFSET = 20  # in VkPhysicalDeviceProperties, after five 32-bit numbers
_PROPERTIES_BYTES = 2048  # more than any version of the structure needs


class _InstanceCreateInfo(ctypes.Structure):
    _fields_ = [
        ("type", ctypes.c_int32),
        ("next", ctypes.c_void_p),
        ("flags", ctypes.c_uint32),
        ("application", ctypes.c_void_p),
        ("layer_count", ctypes.c_uint32),
        ("layers", ctypes.c_void_p),
        ("extension_count", ctypes.c_uint32),
        ("extensions", ctypes.c_void_p),
    ]


def devices() -> list[tuple[str, int]]:
    """(name, VkPhysicalDeviceType) of every device, in the loader's order."""
    vulkan = ctypes.CDLL("vulkan-1.dll" if os.name == "nt" else "libvulkan.so.1")
    instance = ctypes.c_void_p()
    information = _InstanceCreateInfo(type=1)  # VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO
    if vulkan.vkCreateInstance(ctypes.byref(information), None, ctypes.byref(instance)) != 0:
        return []
    count = ctypes.c_uint32()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
    handles = (ctypes.c_void_p * count.value)()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), handles)
    found = []
    for handle in handles:
        properties = ctypes.create_string_buffer(_PROPERTIES_BYTES)
        vulkan.vkGetPhysicalDeviceProperties(ctypes.c_void_p(handle), properties)
        kind = int.from_bytes(properties.raw[16:20], "little")
        name = properties.raw[_NAME_OFFSET : _NAME_OFFSET + 256].split(b"\0")[0].decode(errors="replace")
        found.append((name, kind))
    vulkan.vkDestroyInstance(instance, None)
    return found


def chosen_device() -> tuple[str, bool]:
    """Name of the device Taichi takes (a discrete GPU first), and whether it is software."""
    found = devices()
    if not found:
        return "Vulkan device", False
    name, kind = next((entry for entry in found if entry[1] == _DISCRETE), found[0])
    return name, kind == _SOFTWARE
