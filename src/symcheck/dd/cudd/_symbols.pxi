# CUDD's C interface, resolved from the shared library that dd.cudd has loaded. The prototypes are
# those of CUDD 3.0.

cdef extern from "<dlfcn.h>":
    int RTLD_LAZY
    int RTLD_NOLOAD
    void* dlopen(const char*, int)
    void* dlsym(void*, const char*)
    char* dlerror()

ctypedef void DdManager

cdef struct DdNode
cdef struct Children:
    DdNode* T
    DdNode* E
cdef union Payload:
    double value
    Children kids
cdef struct DdNode:
    unsigned int index
    unsigned int ref
    DdNode* next
    Payload type
ctypedef DdNode* Ref

ctypedef DdNode* (*f_dd)(DdManager*) noexcept nogil
ctypedef DdNode* (*f_node)(DdNode*) noexcept nogil
ctypedef double (*f_value)(DdNode*) noexcept nogil
ctypedef int (*f_is)(DdNode*) noexcept nogil
ctypedef DdNode* (*f_int)(DdManager*, int) noexcept nogil
ctypedef DdNode* (*f_const)(DdManager*, double) noexcept nogil
ctypedef DdNode* (*f_2)(DdManager*, DdNode*, DdNode*) noexcept nogil
ctypedef DdNode* (*f_3)(DdManager*, DdNode*, DdNode*, DdNode*) noexcept nogil
ctypedef DdNode* (*f_unique)(DdManager*, int, DdNode*, DdNode*) noexcept nogil
ctypedef void (*f_drop)(DdManager*, DdNode*) noexcept nogil
ctypedef int (*f_leq)(DdManager*, DdNode*, DdNode*) noexcept nogil
ctypedef int (*f_get)(DdManager*) noexcept nogil
ctypedef int (*f_get_int)(DdManager*, int) noexcept nogil
ctypedef unsigned int (*f_get_unsigned)(DdManager*) noexcept nogil
ctypedef long (*f_get_long)(DdManager*) noexcept nogil
ctypedef double (*f_get_double)(DdManager*) noexcept nogil
ctypedef void (*f_set)(DdManager*) noexcept nogil
ctypedef void (*f_set_double)(DdManager*, double) noexcept nogil
ctypedef size_t (*f_set_size)(DdManager*, size_t) noexcept nogil
ctypedef DdNode* (*f_look2)(DdManager*, void*, DdNode*, DdNode*) noexcept nogil
ctypedef DdNode* (*f_look3)(DdManager*, uintptr_t, DdNode*, DdNode*, DdNode*) noexcept nogil
ctypedef void (*f_keep2)(DdManager*, void*, DdNode*, DdNode*, DdNode*) noexcept nogil
ctypedef void (*f_keep3)(DdManager*, uintptr_t, DdNode*, DdNode*, DdNode*, DdNode*) noexcept nogil
ctypedef int (*f_support)(DdManager*, DdNode*, int**) noexcept nogil
ctypedef int (*f_sharing)(DdNode**, int) noexcept nogil
ctypedef int (*stop_callback)(const void*) noexcept nogil
ctypedef void (*f_on_stop)(DdManager*, stop_callback, void*) noexcept nogil
ctypedef void (*memory_callback)(size_t) noexcept nogil
ctypedef memory_callback (*f_on_memory)(DdManager*, memory_callback) noexcept nogil
ctypedef int (*hook_function)(DdManager*, const char*, void*) noexcept nogil
ctypedef int (*f_hook)(DdManager*, hook_function, int) noexcept nogil
ctypedef void* (*f_get_pointer)(DdManager*) noexcept nogil
ctypedef void (*f_set_pointer)(DdManager*, void*) noexcept nogil
ctypedef void* (*f_tree)(DdManager*, unsigned int, unsigned int, unsigned int) noexcept nogil
ctypedef int (*f_reduce)(DdManager*, int, int) noexcept nogil
ctypedef int (*f_shuffle)(DdManager*, int*) noexcept nogil

cdef f_dd Cudd_ReadOne, Cudd_ReadZero, Cudd_ReadLogicZero
cdef f_node Cudd_T, Cudd_E
cdef f_value Cudd_V
cdef f_is Cudd_DagSize
cdef f_int Cudd_bddIthVar
cdef f_const cuddUniqueConst
cdef f_2 Cudd_bddAnd, Cudd_bddOr, Cudd_bddXor, Cudd_bddExistAbstract, Cudd_bddUnivAbstract, Cudd_Cofactor, Cudd_bddRestrict
cdef f_2 cuddBddAndRecur
cdef f_3 Cudd_bddIte, Cudd_bddAndAbstract, cuddBddIteRecur
cdef f_unique cuddUniqueInter
cdef f_drop Cudd_RecursiveDeref, Cudd_IterDerefBdd
cdef f_leq Cudd_bddLeq
cdef f_get Cudd_ReadSize, Cudd_ReadErrorCode, Cudd_ReadPeakLiveNodeCount, Cudd_ReadGarbageCollections, Cudd_DebugCheck
cdef f_get_int Cudd_ReadPerm, Cudd_ReadInvPerm, cuddGarbageCollect
cdef f_get_unsigned Cudd_ReadKeys, Cudd_ReadDead
cdef f_get_long Cudd_ReadMemoryInUse
cdef f_get_double Cudd_ReadCacheLookUps
cdef f_set Cudd_AutodynDisable, Cudd_ClearErrorCode, Cudd_UnregisterTerminationCallback, Cudd_FreeTree
cdef f_set Cudd_EnableGarbageCollection, Cudd_DisableGarbageCollection
cdef f_set_double Cudd_SetEpsilon, Cudd_SetMaxGrowth
cdef f_set_size Cudd_SetMaxMemory
cdef f_look2 cuddCacheLookup2
cdef f_look3 cuddCacheLookup
cdef f_keep2 cuddCacheInsert2
cdef f_keep3 cuddCacheInsert
cdef f_support Cudd_SupportIndices
cdef f_sharing Cudd_SharingSize
cdef f_on_stop Cudd_RegisterTerminationCallback
cdef memory_callback Cudd_OutOfMemSilent
cdef f_on_memory Cudd_RegisterOutOfMemoryCallback
cdef f_hook Cudd_AddHook, Cudd_RemoveHook
cdef f_get_pointer Cudd_ReadApplicationHook
cdef f_set_pointer Cudd_SetApplicationHook
cdef f_tree Cudd_MakeTreeNode
cdef f_reduce Cudd_ReduceHeap
cdef f_shuffle Cudd_ShuffleHeap


cdef int _resolve(void* library, const char* name, void** target) except -1:
    target[0] = dlsym(library, name)
    if target[0] is NULL:
        raise ImportError(
            f"{cudd.__file__} does not export {name.decode()}: symcheck needs the Linux wheel of dd {REQUIRED_VERSION} "
            f"(pip install --force-reinstall dd=={REQUIRED_VERSION})"
        )
    return 0


cdef int _resolve_all() except -1:
    path = cudd.__file__.encode()
    cdef void* library = dlopen(path, RTLD_LAZY | RTLD_NOLOAD)
    if library is NULL:
        raise ImportError(f"the shared library {cudd.__file__} of dd.cudd is not loaded as such, so CUDD cannot be reached")
    _resolve(library, b"Cudd_ReadOne", <void**>&Cudd_ReadOne)
    _resolve(library, b"Cudd_ReadZero", <void**>&Cudd_ReadZero)
    _resolve(library, b"Cudd_ReadLogicZero", <void**>&Cudd_ReadLogicZero)
    _resolve(library, b"Cudd_T", <void**>&Cudd_T)
    _resolve(library, b"Cudd_E", <void**>&Cudd_E)
    _resolve(library, b"Cudd_V", <void**>&Cudd_V)
    _resolve(library, b"Cudd_DagSize", <void**>&Cudd_DagSize)
    _resolve(library, b"Cudd_bddIthVar", <void**>&Cudd_bddIthVar)
    _resolve(library, b"cuddUniqueConst", <void**>&cuddUniqueConst)
    _resolve(library, b"Cudd_bddAnd", <void**>&Cudd_bddAnd)
    _resolve(library, b"Cudd_bddOr", <void**>&Cudd_bddOr)
    _resolve(library, b"Cudd_bddXor", <void**>&Cudd_bddXor)
    _resolve(library, b"Cudd_bddExistAbstract", <void**>&Cudd_bddExistAbstract)
    _resolve(library, b"Cudd_bddUnivAbstract", <void**>&Cudd_bddUnivAbstract)
    _resolve(library, b"Cudd_Cofactor", <void**>&Cudd_Cofactor)
    _resolve(library, b"Cudd_bddRestrict", <void**>&Cudd_bddRestrict)
    _resolve(library, b"cuddBddAndRecur", <void**>&cuddBddAndRecur)
    _resolve(library, b"Cudd_bddIte", <void**>&Cudd_bddIte)
    _resolve(library, b"Cudd_bddAndAbstract", <void**>&Cudd_bddAndAbstract)
    _resolve(library, b"cuddBddIteRecur", <void**>&cuddBddIteRecur)
    _resolve(library, b"cuddUniqueInter", <void**>&cuddUniqueInter)
    _resolve(library, b"Cudd_RecursiveDeref", <void**>&Cudd_RecursiveDeref)
    _resolve(library, b"Cudd_IterDerefBdd", <void**>&Cudd_IterDerefBdd)
    _resolve(library, b"Cudd_bddLeq", <void**>&Cudd_bddLeq)
    _resolve(library, b"Cudd_ReadSize", <void**>&Cudd_ReadSize)
    _resolve(library, b"Cudd_ReadErrorCode", <void**>&Cudd_ReadErrorCode)
    _resolve(library, b"Cudd_ReadPeakLiveNodeCount", <void**>&Cudd_ReadPeakLiveNodeCount)
    _resolve(library, b"Cudd_ReadGarbageCollections", <void**>&Cudd_ReadGarbageCollections)
    _resolve(library, b"Cudd_DebugCheck", <void**>&Cudd_DebugCheck)
    _resolve(library, b"Cudd_ReadPerm", <void**>&Cudd_ReadPerm)
    _resolve(library, b"Cudd_ReadInvPerm", <void**>&Cudd_ReadInvPerm)
    _resolve(library, b"cuddGarbageCollect", <void**>&cuddGarbageCollect)
    _resolve(library, b"Cudd_ReadKeys", <void**>&Cudd_ReadKeys)
    _resolve(library, b"Cudd_ReadDead", <void**>&Cudd_ReadDead)
    _resolve(library, b"Cudd_ReadMemoryInUse", <void**>&Cudd_ReadMemoryInUse)
    _resolve(library, b"Cudd_ReadCacheLookUps", <void**>&Cudd_ReadCacheLookUps)
    _resolve(library, b"Cudd_AutodynDisable", <void**>&Cudd_AutodynDisable)
    _resolve(library, b"Cudd_ClearErrorCode", <void**>&Cudd_ClearErrorCode)
    _resolve(library, b"Cudd_UnregisterTerminationCallback", <void**>&Cudd_UnregisterTerminationCallback)
    _resolve(library, b"Cudd_FreeTree", <void**>&Cudd_FreeTree)
    _resolve(library, b"Cudd_EnableGarbageCollection", <void**>&Cudd_EnableGarbageCollection)
    _resolve(library, b"Cudd_DisableGarbageCollection", <void**>&Cudd_DisableGarbageCollection)
    _resolve(library, b"Cudd_SetEpsilon", <void**>&Cudd_SetEpsilon)
    _resolve(library, b"Cudd_SetMaxGrowth", <void**>&Cudd_SetMaxGrowth)
    _resolve(library, b"Cudd_SetMaxMemory", <void**>&Cudd_SetMaxMemory)
    _resolve(library, b"cuddCacheLookup2", <void**>&cuddCacheLookup2)
    _resolve(library, b"cuddCacheLookup", <void**>&cuddCacheLookup)
    _resolve(library, b"cuddCacheInsert2", <void**>&cuddCacheInsert2)
    _resolve(library, b"cuddCacheInsert", <void**>&cuddCacheInsert)
    _resolve(library, b"Cudd_SupportIndices", <void**>&Cudd_SupportIndices)
    _resolve(library, b"Cudd_SharingSize", <void**>&Cudd_SharingSize)
    _resolve(library, b"Cudd_RegisterTerminationCallback", <void**>&Cudd_RegisterTerminationCallback)
    _resolve(library, b"Cudd_OutOfMemSilent", <void**>&Cudd_OutOfMemSilent)
    _resolve(library, b"Cudd_RegisterOutOfMemoryCallback", <void**>&Cudd_RegisterOutOfMemoryCallback)
    _resolve(library, b"Cudd_AddHook", <void**>&Cudd_AddHook)
    _resolve(library, b"Cudd_RemoveHook", <void**>&Cudd_RemoveHook)
    _resolve(library, b"Cudd_ReadApplicationHook", <void**>&Cudd_ReadApplicationHook)
    _resolve(library, b"Cudd_SetApplicationHook", <void**>&Cudd_SetApplicationHook)
    _resolve(library, b"Cudd_MakeTreeNode", <void**>&Cudd_MakeTreeNode)
    _resolve(library, b"Cudd_ReduceHeap", <void**>&Cudd_ReduceHeap)
    _resolve(library, b"Cudd_ShuffleHeap", <void**>&Cudd_ShuffleHeap)
    return 0


_resolve_all()
