# CUDD's C interface, resolved from a shared library. The prototypes are those of CUDD 3.0.

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
ctypedef DdManager* (*f_init)(unsigned int, unsigned int, unsigned int, unsigned int, size_t) noexcept nogil
ctypedef void (*f_set_unsigned)(DdManager*, unsigned int) noexcept nogil
ctypedef int (*f_shuffle)(DdManager*, int*) noexcept nogil

cdef f_dd Cudd_ReadOne, Cudd_ReadZero, Cudd_ReadLogicZero
cdef f_node Cudd_T, Cudd_E
cdef f_value Cudd_V
cdef f_is Cudd_DagSize
cdef f_int Cudd_bddIthVar
cdef f_const cuddUniqueConst
cdef f_2 Cudd_bddAnd, Cudd_bddOr, Cudd_bddXor, Cudd_bddExistAbstract, Cudd_Cofactor
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
cdef f_init Cudd_Init
cdef f_set_unsigned Cudd_SetLooseUpTo, Cudd_SetMinHit
cdef f_set Cudd_Quit
cdef f_shuffle Cudd_ShuffleHeap


cdef int _resolve_all() except -1:
    name = library()
    cdef uintptr_t target
    try:
        loaded_library = ctypes.CDLL(name)
    except OSError as error:
        raise UnsupportedError(f"the shared library {name} with CUDD cannot be loaded: {error}") from None
    for function, target in [
        ("Cudd_ReadOne", <uintptr_t>&Cudd_ReadOne),
        ("Cudd_ReadZero", <uintptr_t>&Cudd_ReadZero),
        ("Cudd_ReadLogicZero", <uintptr_t>&Cudd_ReadLogicZero),
        ("Cudd_T", <uintptr_t>&Cudd_T),
        ("Cudd_E", <uintptr_t>&Cudd_E),
        ("Cudd_V", <uintptr_t>&Cudd_V),
        ("Cudd_DagSize", <uintptr_t>&Cudd_DagSize),
        ("Cudd_bddIthVar", <uintptr_t>&Cudd_bddIthVar),
        ("cuddUniqueConst", <uintptr_t>&cuddUniqueConst),
        ("Cudd_bddAnd", <uintptr_t>&Cudd_bddAnd),
        ("Cudd_bddOr", <uintptr_t>&Cudd_bddOr),
        ("Cudd_bddXor", <uintptr_t>&Cudd_bddXor),
        ("Cudd_bddExistAbstract", <uintptr_t>&Cudd_bddExistAbstract),
        ("Cudd_Cofactor", <uintptr_t>&Cudd_Cofactor),
        ("cuddBddAndRecur", <uintptr_t>&cuddBddAndRecur),
        ("Cudd_bddIte", <uintptr_t>&Cudd_bddIte),
        ("Cudd_bddAndAbstract", <uintptr_t>&Cudd_bddAndAbstract),
        ("cuddBddIteRecur", <uintptr_t>&cuddBddIteRecur),
        ("cuddUniqueInter", <uintptr_t>&cuddUniqueInter),
        ("Cudd_RecursiveDeref", <uintptr_t>&Cudd_RecursiveDeref),
        ("Cudd_IterDerefBdd", <uintptr_t>&Cudd_IterDerefBdd),
        ("Cudd_bddLeq", <uintptr_t>&Cudd_bddLeq),
        ("Cudd_ReadSize", <uintptr_t>&Cudd_ReadSize),
        ("Cudd_ReadErrorCode", <uintptr_t>&Cudd_ReadErrorCode),
        ("Cudd_ReadPeakLiveNodeCount", <uintptr_t>&Cudd_ReadPeakLiveNodeCount),
        ("Cudd_ReadGarbageCollections", <uintptr_t>&Cudd_ReadGarbageCollections),
        ("Cudd_DebugCheck", <uintptr_t>&Cudd_DebugCheck),
        ("Cudd_ReadPerm", <uintptr_t>&Cudd_ReadPerm),
        ("Cudd_ReadInvPerm", <uintptr_t>&Cudd_ReadInvPerm),
        ("cuddGarbageCollect", <uintptr_t>&cuddGarbageCollect),
        ("Cudd_ReadKeys", <uintptr_t>&Cudd_ReadKeys),
        ("Cudd_ReadDead", <uintptr_t>&Cudd_ReadDead),
        ("Cudd_ReadMemoryInUse", <uintptr_t>&Cudd_ReadMemoryInUse),
        ("Cudd_ReadCacheLookUps", <uintptr_t>&Cudd_ReadCacheLookUps),
        ("Cudd_AutodynDisable", <uintptr_t>&Cudd_AutodynDisable),
        ("Cudd_ClearErrorCode", <uintptr_t>&Cudd_ClearErrorCode),
        ("Cudd_UnregisterTerminationCallback", <uintptr_t>&Cudd_UnregisterTerminationCallback),
        ("Cudd_FreeTree", <uintptr_t>&Cudd_FreeTree),
        ("Cudd_EnableGarbageCollection", <uintptr_t>&Cudd_EnableGarbageCollection),
        ("Cudd_DisableGarbageCollection", <uintptr_t>&Cudd_DisableGarbageCollection),
        ("Cudd_SetEpsilon", <uintptr_t>&Cudd_SetEpsilon),
        ("Cudd_SetMaxGrowth", <uintptr_t>&Cudd_SetMaxGrowth),
        ("Cudd_SetMaxMemory", <uintptr_t>&Cudd_SetMaxMemory),
        ("cuddCacheLookup2", <uintptr_t>&cuddCacheLookup2),
        ("cuddCacheLookup", <uintptr_t>&cuddCacheLookup),
        ("cuddCacheInsert2", <uintptr_t>&cuddCacheInsert2),
        ("cuddCacheInsert", <uintptr_t>&cuddCacheInsert),
        ("Cudd_SupportIndices", <uintptr_t>&Cudd_SupportIndices),
        ("Cudd_SharingSize", <uintptr_t>&Cudd_SharingSize),
        ("Cudd_RegisterTerminationCallback", <uintptr_t>&Cudd_RegisterTerminationCallback),
        ("Cudd_OutOfMemSilent", <uintptr_t>&Cudd_OutOfMemSilent),
        ("Cudd_RegisterOutOfMemoryCallback", <uintptr_t>&Cudd_RegisterOutOfMemoryCallback),
        ("Cudd_AddHook", <uintptr_t>&Cudd_AddHook),
        ("Cudd_RemoveHook", <uintptr_t>&Cudd_RemoveHook),
        ("Cudd_ReadApplicationHook", <uintptr_t>&Cudd_ReadApplicationHook),
        ("Cudd_SetApplicationHook", <uintptr_t>&Cudd_SetApplicationHook),
        ("Cudd_MakeTreeNode", <uintptr_t>&Cudd_MakeTreeNode),
        ("Cudd_ReduceHeap", <uintptr_t>&Cudd_ReduceHeap),
        ("Cudd_ShuffleHeap", <uintptr_t>&Cudd_ShuffleHeap),
        ("Cudd_Init", <uintptr_t>&Cudd_Init),
        ("Cudd_Quit", <uintptr_t>&Cudd_Quit),
        ("Cudd_SetLooseUpTo", <uintptr_t>&Cudd_SetLooseUpTo),
        ("Cudd_SetMinHit", <uintptr_t>&Cudd_SetMinHit),
    ]:
        try:
            symbol = getattr(loaded_library, function)
        except AttributeError:
            raise UnsupportedError(
                f"{name} does not export {function}\n  hint: the wheel of dd {REQUIRED_VERSION} does, as does a "
                "shared library with CUDD 3.0"
            ) from None
        (<uintptr_t*>target)[0] = <uintptr_t>ctypes.cast(symbol, ctypes.c_void_p).value
    return 0
